"""Benchmarks: what `hamotor bench NAME` measures, each a function that returns its account."""

from __future__ import annotations

from hamotor.bench.ensemble import bench_ensemble
from hamotor.bench.kernels import bench_kernels
from hamotor.bench.precision import bench_precision
from hamotor.bench.stability import bench_stability
from hamotor.bench.steps import bench_steps
from hamotor.bench.summary import bench_summary

__all__ = [
    "bench_ensemble",
    "bench_kernels",
    "bench_precision",
    "bench_stability",
    "bench_steps",
    "bench_summary",
]
