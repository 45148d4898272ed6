"""Manifests: every identifier has its path, and a million of them are one entry."""

import json

import pytest

from abbe import Manifest

ENTRIES = ["/A", "/S[0:3]", "/S[0:2,5]/Bush/Leaves[0:2]", "/B"]


def test_every_identifier_has_its_path():
    paths = ["/A", *(f"/S[{i}]" for i in range(3))]
    paths += [f"/S[{i}]/Bush/Leaves[{k}]" for i in (0, 1, 5) for k in range(2)]
    paths.append("/B")
    manifest = Manifest(json.dumps(ENTRIES))
    assert list(manifest) == paths and len(manifest) == len(paths)
    assert list(Manifest(ENTRIES)) == paths
    assert manifest[-1] == "/B" and manifest[1:3] == paths[1:3] and paths[7] in manifest
    with pytest.raises(IndexError):
        manifest[len(paths)]


def test_a_long_manifest_takes_no_memory():
    manifest = Manifest(["/Outer[0:1000000]/P/Inner[0:4000]"])
    assert len(manifest) == 4 * 10**9
    assert manifest[4 * 10**9 - 1] == "/Outer[999999]/P/Inner[3999]"


@pytest.mark.parametrize("text", ["{", '{"a": 1}', "[1]", '["/A[:]"]', '["/A[,]"]', "null"])
def test_what_is_no_manifest_is_refused(text):
    with pytest.raises(ValueError):
        Manifest(text)


def test_nothing_has_no_paths():
    assert len(Manifest([])) == 0 and list(Manifest("[]")) == []
    assert list(Manifest(["/A[4:4]", "/B"])) == ["/B"]
