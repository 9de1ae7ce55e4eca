"""The peers, started once for all tests; a test of one that is not installed is skipped."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.peers import environment
from tests.peers.conversation import Peer, node_peer, python_peer


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker."""
    config.addinivalue_line("markers", "peers: compares with other libraries, if they are there")


def require(name: str, present: bool) -> None:
    """Skip unless the peer is there."""
    if not present:
        pytest.skip(f"{name} is not installed; `{environment.INSTALL}` installs it")


def _python(name: str) -> Iterator[Peer]:
    require(name, environment.has_python_peers())
    peer = python_peer(name)
    yield peer
    peer.end()


@pytest.fixture(scope="session")
def clifford() -> Iterator[Peer]:
    """Clifford."""
    yield from _python("clifford")


@pytest.fixture(scope="session")
def kingdon() -> Iterator[Peer]:
    """Kingdon."""
    yield from _python("kingdon")


@pytest.fixture(scope="session")
def galgebra() -> Iterator[Peer]:
    """GAlgebra."""
    yield from _python("galgebra")


@pytest.fixture(scope="session")
def ganja() -> Iterator[Peer]:
    """ganja.js."""
    require("ganja.js", environment.has_node_peers())
    peer = node_peer("ganja")
    yield peer
    peer.end()
