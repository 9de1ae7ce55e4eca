"""What happens to a scene once its C++ text exists: compile, load, step, record, report, draw.

`build` makes the shared library, `library` binds its C ABI, `runner` steps it, `dataset` keeps the
trajectory, `report` writes `run.json`, `pictures` draws, `simulation` joins them, `result` is what
a caller holds in the end, `comparison` sets two runs side by side.  Nothing here knows an algebra:
names, units and frames arrive through `hamotor_describe`.
"""
