"""The registry of public recordings: whole, honest, and no file of it is taken for another."""

import hashlib
import tomllib
from pathlib import Path

import pytest
from fixtures.paths import ROOT
from fixtures.refusals import assert_one_line, assert_refused

from frictionid.data.readers import public_collections
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.public_collections import (
    Collection,
    cached,
    collections,
    copy_collection,
    count_present,
    download,
)

TOY = {"one.csv": b"time,q,u\n0,0,1\n1,1,1\n2,0,1\n", "day/two.csv": b"time,q,u\n0,0,1\n1,1,1\n"}


def sha(content):
    return hashlib.sha256(content).hexdigest()


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """A registry with one collection whose folder is in tmp_path."""
    files = [
        {"name": name, "source": f"raw/{name}", "sha256": sha(text), "reduced": sha(text + b"r")}
        for name, text in TOY.items()
    ]
    collection = Collection(
        title="A toy",
        page="https://example.org/toy",
        base="https://example.org/commit/",
        licence="MIT",
        redistribution="allowed",
        citation="None",
        files=[public_collections.File(**file) for file in files],
    )
    monkeypatch.setattr(public_collections, "collections", lambda: {"toy": collection})
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path / "data"))
    return tmp_path


def copied(toy, files):
    """Names of files that are missing once these were copied."""
    return copy_collection("toy", write(toy / "source", files))


def write(folder, files):
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


# --- What stands in it ---------------------------------------------------------------------------


def test_every_entry_says_where_whose_and_which_file():
    for name, collection in collections().items():
        places = [file.name for file in collection.files]
        assert len(places) == len(set(places)), name
        assert collection.licence and collection.redistribution and collection.citation
        for file in collection.files:
            hashes = [h for h in (file.sha256, file.reduced) if h is not None]
            assert hashes and all(len(h) == 64 and int(h, 16) >= 0 for h in hashes)
            assert (file.source is None) == (file.sha256 is None)
            if file.source:
                commit = collection.base.rstrip("/").rpartition("/")[2]
                assert len(commit) == 40 and int(commit, 16) >= 0


def test_data_sets_state_the_licence_and_the_commit_of_their_collection():
    known = 0
    for path in sorted((ROOT / "data").glob("*/dataset.toml")):
        document = tomllib.loads(path.read_text())
        if "collection" in document:
            collection = collections()[document["collection"]]
            assert collection.licence.split(",")[0] in document["licence"], path
            assert document["citation"][:6] in collection.citation, path
            assert not collection.base or collection.base.split("/")[-2] in document["origin"]
            known += 1
    assert known >= 8


# --- Getting and checking ------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["", "raw/"])
def test_files_are_taken_from_a_folder_in_either_layout(toy, layout):
    assert copied(toy, {layout + name: text for name, text in TOY.items()}) == []
    assert {name: (cached("toy") / name).read_bytes() for name in TOY} == TOY
    assert count_present("toy") == 2
    assert sorted(p.name for p in cached("toy").rglob("*") if p.is_file()) == ["one.csv", "two.csv"]


def test_reduced_files_are_taken_under_their_own_name(toy):
    assert copied(toy, {"one.csv.gz": TOY["one.csv"] + b"r"}) == ["day/two.csv"]
    assert (cached("toy") / "one.csv.gz").is_file()


def test_a_wrong_hash_prints_both_and_nothing_is_copied(toy):
    with assert_refused(sha(b"other")) as caught:
        copied(toy, {**TOY, "day/two.csv": b"other"})
    assert sha(TOY["day/two.csv"]) in str(caught.value)
    assert not cached("toy").exists()


def test_a_folder_without_the_files_is_refused(toy):
    with assert_refused("is no folder"):
        copy_collection("toy", toy / "nowhere")
    with assert_refused(r"has no file of toy; it should hold one\.csv"):
        copied(toy, {"else.csv": b""})


@pytest.mark.usefixtures("toy")
def test_without_a_network_the_way_out_is_printed(monkeypatch, tmp_path, run):
    import pooch

    def unreachable(*_, **__):
        raise OSError("Network is unreachable\nand more")

    monkeypatch.setattr(pooch, "retrieve", unreachable)
    status, out, err = run(tmp_path, "data get toy")
    assert status == 2
    assert "licence MIT; redistribution allowed" in out
    assert "https://example.org/commit/raw/one.csv cannot be downloaded" in err
    assert "frictionid data get toy --from FOLDER" in err
    assert err.count("\n") == 1


@pytest.mark.usefixtures("toy")
def test_downloads_are_checked_against_the_hash(monkeypatch):
    import pooch

    def other(_, url, output_file, *__):
        Path(output_file).write_bytes(TOY["one.csv"] if "one" in url else b"other")

    monkeypatch.setattr(pooch.HTTPDownloader, "__call__", other)
    done = []
    with assert_refused(sha(b"other")) as caught:
        download("toy", done.append)
    assert sha(TOY["day/two.csv"]) in str(caught.value)
    assert done == ["one.csv"]
    assert count_present("toy") == 1


def test_a_collection_without_an_address_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path))
    with assert_refused(r"nonlinearbenchmark.*data get emps --from FOLDER"):
        download("emps", print)


def test_unknown_collections_are_named_with_the_nearest(tmp_path, run):
    outcome = run(tmp_path, "data get emsp")
    assert_one_line(outcome, "collection 'emsp' is unknown; did you mean 'emps'?")


def test_the_list_shows_licences_and_what_is_here(toy, run):
    copied(toy, {"one.csv": TOY["one.csv"]})
    status, out, _ = run(toy, "data list")
    assert status == 0
    for words in ("toy", "MIT", "allowed", "2, here 1", "of all originals known"):
        assert words in out


def test_what_the_commands_print_is_honest_about_unknown_hashes(tmp_path, monkeypatch, run):
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path / "data"))
    source = write(tmp_path / "source", {"DATA_EMPS.mat": b"mine"})
    status, out, _ = run(tmp_path, "data get emps --from", source)
    assert status == 0
    assert "redistribution not stated" in out
    assert "it was not verified" in out
    assert "of 0 of 1 originals known" in run(tmp_path, "data list")[1]


# --- Data sets of a collection -------------------------------------------------------------------

DATASET = """
name = "toy"
collection = "toy"
[mechanism]
kind = "pendulum"
[columns]
time = "time"
angle = ["q"]
torque = ["u"]
[recordings]
patterns = ["one.csv*"]
"""


def test_a_data_set_finds_its_collection_and_refuses_another_file(toy):
    (toy / "dataset.toml").write_text(DATASET)
    copied(toy, TOY)
    assert load_dataset(toy).hashes == {"one.csv": sha(TOY["one.csv"])}
    (cached("toy") / "one.csv").write_bytes(TOY["one.csv"] + b"3,0,1\n")
    with assert_refused("is not the registered file.*data get toy"):
        load_dataset(toy)


def test_the_users_cache_is_the_last_place_looked_at(toy, monkeypatch):
    import pooch

    (toy / "dataset.toml").write_text(DATASET)
    monkeypatch.delenv("FRICTIONID_DATA")
    monkeypatch.setattr(pooch, "os_cache", lambda name: toy / "cache" / name)
    (toy / "cache/frictionid/toy/day").mkdir(parents=True)  # left by a failed download
    with assert_refused("or get it with: frictionid data get toy"):
        load_dataset(toy)
    write(toy / "cache/frictionid/toy", {"one.csv": TOY["one.csv"]})
    assert len(load_dataset(toy).recordings) == 1
