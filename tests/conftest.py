"""What every test stands on: strict arrays, a home of its own, no server and no network but the loopback.

The environment is set before anything imports JAX or Prefect, and child processes inherit it.
"""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import signal
import tempfile
import urllib.request
import uuid
from collections.abc import Iterator
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
CACHE = REPO / ".cache"
WORKER = os.environ.get("PYTEST_XDIST_WORKER", "")
HOME = Path(tempfile.mkdtemp(prefix="dreamfields-tests-"))
atexit.register(shutil.rmtree, HOME, ignore_errors=True)

# A developer's own server, account or store is never spoken to.
for name in list(os.environ):
    if name.startswith(("PREFECT_", "AWS_", "DREAMFIELDS_", "HF_")):
        del os.environ[name]

os.environ.update(
    HOME=str(HOME),
    XDG_CACHE_HOME=str(HOME / ".cache"),
    PREFECT_HOME=str(HOME / "prefect"),
    PREFECT_SERVER_ANALYTICS_ENABLED="false",
    PREFECT_LOGGING_TO_API_ENABLED="false",
    PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS="120",
    DO_NOT_TRACK="1",
    HF_HUB_OFFLINE="1",
    AWS_EC2_METADATA_DISABLED="true",
    MPLBACKEND="Agg",
    MPLCONFIGDIR=str(CACHE / "matplotlib"),
    # Compiled programs are kept between runs of the suite: most of its time would be compilation. Each process keeps its own, as JAX
    # writes them in place, where another would find half of one.
    JAX_COMPILATION_CACHE_DIR=str(CACHE / "jax" / WORKER),
    JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS="0",
    JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES="-1",
    # An array of shape [3] never meets one of shape [4, 3] by accident: where ranks differ, the code says how they meet.
    JAX_NUMPY_RANK_PROMOTION="raise",
)
(CACHE / "matplotlib").mkdir(parents=True, exist_ok=True)

# What a shell begins in the background ignores Ctrl-C, and so would every command that a test begins and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import hypothesis  # noqa: E402
import jax  # noqa: E402
import pytest  # noqa: E402

# The same examples every time: a suite that fails by chance is not believed when it fails with cause.
hypothesis.settings.register_profile("house", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("house")


@pytest.fixture
def strict_dtypes() -> Iterator[None]:
    """No implicit change of type within the test: `pytestmark = pytest.mark.usefixtures("strict_dtypes")` for a file of equations.

    Not for all tests, as Optax's Adam raises a float to an integer power.
    """
    with jax.numpy_dtype_promotion("strict"):
        yield


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty home and working directory for a test that runs commands."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / ".cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def s3_server() -> Iterator[str]:
    """The address of an object store on the loopback."""
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)  # a line a request is no concern of these tests
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def s3(s3_server: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of an empty bucket; the environment names its server."""
    monkeypatch.setenv("AWS_ENDPOINT_URL", s3_server)
    for name, value in {"REGION": "us-east-1", "ACCESS_KEY_ID": "test", "SECRET_ACCESS_KEY": "test"}.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    bucket = uuid.uuid4().hex
    urllib.request.urlopen(urllib.request.Request(f"{s3_server}/{bucket}", method="PUT")).close()
    return f"s3://{bucket}"
