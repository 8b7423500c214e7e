"""An S3 server on this machine's loopback, and what its clients must know."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.processes import HOME

BUCKET = "scans"


@dataclass(frozen=True)
class Server:
    """An S3 server: its clients' environment, a client, and the server itself."""

    environment: dict[str, str]
    client: Any
    moto: Any

    def objects(self, prefix: str) -> dict[str, bytes]:
        """Return all objects of a prefix."""
        found = {}
        listed = self.client.list_objects_v2(Bucket=BUCKET, Prefix=f"{prefix}/")
        for one in listed.get("Contents", ()):
            body = self.client.get_object(Bucket=BUCKET, Key=one["Key"])["Body"].read()
            found[one["Key"].removeprefix(f"{prefix}/")] = body
        return found

    def start(self, *words: str | Path) -> subprocess.Popen[str]:
        """Start a command of flawforge."""
        return self.python("-m", "flawforge.cli", *words)

    def python(self, *words: str | Path) -> subprocess.Popen[str]:
        """Start Python as a client of this server."""
        return subprocess.Popen(
            [sys.executable, *words],
            env={**os.environ, **self.environment, "PYTHONPATH": str(HOME)}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def run(self, *words: str | Path) -> tuple[int, str, str]:
        """Run a command of flawforge; return its exit code and outputs."""
        process = self.start(*words)
        said, errors = process.communicate(timeout=240)
        return process.returncode, said, errors


@contextmanager
def serving() -> Iterator[Server]:
    """Serve an empty bucket; needs moto[server]."""
    import boto3
    from moto.server import ThreadedMotoServer

    moto = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    moto.start()
    host, port = moto.get_host_and_port()
    environment = {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "any",
        "AWS_SECRET_ACCESS_KEY": "any", "AWS_DEFAULT_REGION": "us-east-1",
    }  # fmt: skip
    client = boto3.client(
        "s3", endpoint_url=environment["AWS_ENDPOINT_URL"], aws_access_key_id="any",
        aws_secret_access_key="any", region_name="us-east-1",
    )  # fmt: skip
    client.create_bucket(Bucket=BUCKET)
    try:
        yield Server(environment=environment, client=client, moto=moto)
    finally:
        client.close()
        moto.stop()
