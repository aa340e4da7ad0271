# SPDX-License-Identifier: BSD-2-Clause
"""Batches of files on servers: of S3 and of HTTP, which run here."""

import contextlib
import functools
import http.server
import io
import json
import logging
import os
import re
import subprocess
import sys
import threading
import zipfile

import boto3
import pyarrow
import pytest
import s3fs
from moto.server import ThreadedMotoServer

import dynacom
from batch_clips import cut, same
from dynacom import DynacomError
from dynacom.batch_files import find_motions

ROBOT = "anymal_c"
ODD = "sub/b b%20#é?[1]*.npz"
LONG = "ä" * 300  # no disk has such names
#: Where nobody listens.
NOBODY = "http://127.0.0.1:1"


@pytest.fixture(scope="module", autouse=True)
def environment():
    """Nothing of the machine's own settings."""
    with pytest.MonkeyPatch.context() as patch:
        for name in os.environ:
            if name.startswith(("AWS_", "FSSPEC_")):
                patch.delenv(name)
        patch.setenv("NO_PROXY", "127.0.0.1")
        patch.setenv("AWS_ACCESS_KEY_ID", "somebody")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        patch.setenv("AWS_CONFIG_FILE", os.devnull)
        patch.setenv("AWS_SHARED_CREDENTIALS_FILE", os.devnull)
        patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
        patch.setenv("AWS_MAX_ATTEMPTS", "1")
        yield patch


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """A folder."""
    folder = tmp_path_factory.mktemp("clips")
    for number, name in enumerate(("walk.npz", ODD, ".hidden/walk.npz")):
        (folder / name).parent.mkdir(exist_ok=True)
        cut(folder / name, 40 * number, 20)
    (folder / "bad.csv").write_text("x\n")
    (folder / "notes.md").write_text("Motions.")
    return folder


@pytest.fixture(scope="module")
def local(clips):
    """Its table."""
    return dynacom.batch(clips, ROBOT, jobs=1)


@pytest.fixture(scope="module")
def s3(clips, environment):
    """A server whose bucket has that folder twice, with something else beside it."""
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    environment.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    system = s3fs.S3FileSystem(use_listings_cache=False, skip_instance_cache=True)
    system.mkdir("bucket")
    for folder in ("motions", "copy"):
        for path in clips.rglob("*.*"):
            if path.is_file():
                name = path.relative_to(clips).as_posix()
                system.pipe_file(f"bucket/{folder}/{name}", path.read_bytes())
    system.pipe_file("bucket/motions2/walk.npz", b"")
    system.pipe_file(f"bucket/long/{LONG}.npz", (clips / "walk.npz").read_bytes())
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as opened:
        opened.write(clips / "walk.npz", "inside/walk.npz")
    system.pipe_file("bucket/archive.zip", archive.getvalue())
    yield system
    server.stop()


@pytest.fixture
def anew(s3):
    """Who changes the environment wants connections that see it."""
    s3fs.S3FileSystem.clear_instance_cache()
    yield s3
    s3fs.S3FileSystem.clear_instance_cache()


@pytest.fixture(scope="module")
def web(clips):
    """Where a server of HTTP has that folder."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *arguments):
            pass

    handler = functools.partial(Quiet, directory=clips)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=[0.05]).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def names(clips, url):
    """The files that a batch of the folder is to find, at url."""
    return [file.replace(str(clips), url) for file in find_motions(clips)]


def moved(table, start, url):
    """The table of another place."""
    for name in ("file", "error"):
        index = table.schema.get_field_index(name)
        column = [t and t.replace(str(start), url) for t in table[name].to_pylist()]
        table = table.set_column(index, table.schema.field(name), pyarrow.array(column))
    return table


# S3.


def test_which_files(clips, s3):
    url = "s3://bucket/motions"
    everything = names(clips, url)
    assert len(everything) == 3
    assert everything[-2:] == [f"{url}/{ODD}", f"{url}/walk.npz"]
    for path in (url, f"{url}/", f"{url}/*", f"{url}/**"):
        assert list(find_motions(path)) == everything, path
    for path, name in (
        (f"{url}/*.npz", "walk.npz"),
        (f"{url}/**/b*.npz", ODD),
        (f"{url}/*/b?b*.npz", ODD),
        (f"{url}/{ODD}", ODD),
        (f"{url}/.hid*/*", ".hidden/walk.npz"),
        (f"{url}/gone.npz", "gone.npz"),  # which will be a row
        (f"{url}/notes.md", "notes.md"),
    ):
        assert list(find_motions(path)) == [f"{url}/{name}"], path
    both = [file.replace("motions", "copy") for file in everything] + everything
    assert list(find_motions(["s3://bucket/motions", "s3://bucket/copy"])) == both
    others = [f"s3://bucket/long/{LONG}.npz", "s3://bucket/motions2/walk.npz"]
    assert list(find_motions("s3://bucket")) == sorted(both + others)


def test_rows_are_those_of_local(clips, local, s3, run, tmp_path):
    url = "s3://bucket/motions"
    local = moved(local, clips, url)
    done = run("batch", url, "--robot", ROBOT, "--out", tmp_path / "out", "--jobs", 1)
    assert (done.returncode, done.stderr) == (0, "")
    table = pyarrow.parquet.read_table(tmp_path / "out" / "clips.parquet")
    assert table["status"].to_pylist() == ["error", "ok", "ok"]
    assert same(table, local)


def test_resume(s3, clips, tmp_path):
    """In one process, which has seen the folder as it was."""
    url = "s3://bucket/copy"
    for path in (f"{url}/*.npz", f"{url}/a?.npz", url):
        with contextlib.suppress(DynacomError):
            find_motions(path)
    before = dynacom.batch(url, ROBOT, out=tmp_path, jobs=1)
    content = (clips / ODD).read_bytes()
    s3.pipe_file("bucket/copy/walk.npz", content)  # changed
    s3.pipe_file("bucket/copy/a1.npz", content)  # new
    s3.rm_file(f"bucket/copy/{ODD}")  # gone
    states = []
    options = {"resume": True, "progress": states.append, "jobs": 1}
    after = dynacom.batch(url, ROBOT, out=tmp_path, **options)
    assert (states[-1].files, states[-1].known) == (3, 1)
    assert after["file"].to_pylist() == [
        f"{url}/{name}" for name in ("a1.npz", "bad.csv", "walk.npz")
    ]
    assert after["sha256"].to_pylist().count(before["sha256"][1].as_py()) == 2
    assert list(find_motions(f"{url}/a?.npz")) == [f"{url}/a1.npz"]


def test_what_is_not_there(s3):
    for url, part in (
        ("s3://nobody/motions", "must be a file or a folder, which is not there"),
        ("s3://nobody", "must be a file or a folder, which is not there"),
        ("s3://bucket/gone", "must be a file or a folder, which is not there"),
        ("s3://bucket/gone/", "must hold motions (.csv,"),
        ("s3://bucket/*.npz", "must hold motions (.csv,"),
        ("s3://", "cannot be searched (Cannot traverse all of S3)"),
        ("nobody://bucket", "cannot be searched (Protocol not known: nobody)"),
    ):
        with pytest.raises(DynacomError, match=re.escape(f"{url}: {part}")):
            find_motions(url)


def test_single_files(s3):
    found = {
        "s3://bucket/gone.npz": "cannot be read (The specified key does not exist.)",
        f"s3://bucket/long/{LONG}.npz": None,
        "s3://nobody/gone.npz": "cannot be read (The specified bucket does not exist)",
        "zip://inside/walk.npz::s3://bucket/archive.zip": None,
    }
    paths = [*list(found)[:3], "zip://inside::s3://bucket/archive.zip"]
    rows = dynacom.batch(paths, ROBOT, jobs=1).to_pylist()
    expected = {file: error and f"{file}: {error}" for file, error in found.items()}
    assert {row["file"]: row["error"] for row in rows} == expected


@pytest.mark.parametrize("path", ["motions", "motions/walk.npz", "motions/*.npz"])
def test_who_is_not_let_in(anew, monkeypatch, path):
    url = f"s3://bucket/{path}"
    start = re.escape(f"{url}: cannot be searched (")
    with monkeypatch.context() as patch:
        patch.setattr("moto.settings.INITIAL_NO_AUTH_ACTION_COUNT", 0.0)
        with pytest.raises(DynacomError, match=start + "(Forbidden|The AWS Access Key Id)"):
            find_motions(url)
    s3fs.S3FileSystem.clear_instance_cache()
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    with pytest.raises(DynacomError, match=start + "Unable to locate credentials"):
        find_motions(url)


def test_who_may_read_files_and_not_list_folders(anew, monkeypatch):
    iam = boto3.client("iam")
    iam.create_user(UserName="reader")
    may = {"Effect": "Allow", "Action": ["s3:GetObject", "s3:HeadObject"], "Resource": "*"}
    policy = json.dumps({"Version": "2012-10-17", "Statement": [may]})
    iam.put_user_policy(UserName="reader", PolicyName="read", PolicyDocument=policy)
    key = iam.create_access_key(UserName="reader")["AccessKey"]
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", key["AccessKeyId"])
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", key["SecretAccessKey"])
    monkeypatch.setattr("moto.settings.INITIAL_NO_AUTH_ACTION_COUNT", 0.0)
    url = "s3://bucket/motions"
    assert list(find_motions(f"{url}/walk.npz")) == [f"{url}/walk.npz"]
    with pytest.raises(DynacomError, match=re.escape(f"{url}: cannot be searched (Access Denied)")):
        find_motions(url)


def test_no_server(anew, monkeypatch, run, tmp_path):
    monkeypatch.setenv("AWS_ENDPOINT_URL", NOBODY)
    url = "s3://bucket/motions"
    done = run("batch", url, "--robot", ROBOT, "--out", tmp_path / "out", "--jobs", 1)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(
        rf'dynacom: {url}: cannot be searched \(Could not connect[^\n]*"{NOBODY}/[^\n]*\)\n',
        done.stderr,
    )
    assert not (tmp_path / "out").exists()


# HTTP.


def test_http(clips, local, web):
    def quoted(name):
        return name.replace(ODD, "sub/b%20b%2520%23%C3%A9%3F%5B1%5D%2A.npz")

    everything = sorted(map(quoted, names(clips, web)))
    for path in (web, f"{web}/", f"{web}/*"):
        assert list(find_motions(path)) == everything
    paths = [web, f"{web}/walk.npz?signature=a/b", f"{web}/gone.npz"]
    rows = {row["file"]: row for row in dynacom.batch(paths, ROBOT, jobs=1).to_pylist()}
    for row in local.to_pylist():
        other = rows.pop(quoted(row["file"].replace(str(clips), web)))
        assert (other["status"], other["sha256"]) == (row["status"], row["sha256"])
        assert other["severity"] == row["severity"]
    signed = rows.pop(f"{web}/walk.npz?signature=a/b")
    assert (signed["status"], signed["sha256"]) == ("ok", local["sha256"][-1].as_py())
    assert [row["error"] for row in rows.values()] == [
        f"{web}/gone.npz: cannot be read (No such file or directory)"
    ]


def test_http_errors(web):
    for url, part in (
        (f"{web}/gone", "must be a file or a folder, which is not there"),
        (f"{web}/gone/", "must hold motions (.csv,"),
        (f"{web}/sub/*.csv", "must hold motions (.csv,"),
        (f"{NOBODY}/a.npz", "cannot be searched (Connect"),
    ):
        with pytest.raises(DynacomError, match=re.escape(f"{url}: {part}")):
            find_motions(url)


# Others.


def test_file(clips):
    url = f"file://{clips}"
    for path in (url, f"{url}/*"):
        assert list(find_motions(path)) == names(clips, url)


WITHOUT = """
import sys
from dynacom import DynacomError
from dynacom.batch_files import find_motions

class Missing:
    def find_spec(self, name, *others):
        if name == sys.argv[1]:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)

sys.meta_path.insert(0, Missing())
try:
    find_motions(sys.argv[2])
except DynacomError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("module", "url", "message"),
    [
        ("fsspec", "s3://bucket", "needs a package (*): pip install s3fs"),
        ("fsspec", "sftp://server", "needs a package (*): pip install fsspec"),
        ("s3fs", "s3://bucket", "needs a package (Install s3fs*): pip install s3fs"),
        ("s3fs", "zip://::s3://bucket/a.zip", "needs a package (Install s3fs*): pip install s3fs"),
        ("aiohttp", "https://server/a.npz", "needs a package (*): pip install fsspec aiohttp"),
        ("paramiko", "sftp://server", 'needs a package (*"paramiko"*)'),
    ],
)
def test_packages_that_are_not_installed(module, url, message):
    """In a process of its own: what has been imported here stays."""
    command = [sys.executable, "-c", WITHOUT, module, url]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    expected = ".*".join(map(re.escape, f"{url}: {message}\n".split("*")))
    assert re.fullmatch(expected, done.stdout), done
