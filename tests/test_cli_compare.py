"""`chilopod compare` as a user meets it."""

import json

from helpers.command_line import remarks, run


def test_a_table_and_files(tmp_path):
    code, out, err = run("compare", "aoi2022-planar", "aoi2022", "--show", "onset")
    assert (code, remarks(err)) == (0, [])
    assert out.splitlines()[0] == "aoi2022-planar and aoi2022: onset 11.99 N*mm/deg (bends) and 11.58 N*mm/deg (bends)"
    assert out.splitlines()[2].split()[0] == "legs.forward_offset"
    code, out, _ = run(
        "compare", "aoi2022-planar", "aoi2022", "--show", "speed", "--json", "--out", str(tmp_path / "c")
    )
    assert (code, json.loads(out)) == (0, json.loads((tmp_path / "c" / "comparison.json").read_text()))
    assert (tmp_path / "c" / "comparison.svg").exists()


def test_mistakes_are_named_in_one_line():
    for arguments, said in (
        (("aoi2022-planar", "aoi20222"), "did you mean 'aoi2022'?"),
        (("aoi2022-planar", "aoi2022", "--show", "sped"), "--show = 'sped': is not known; did you mean 'speed'?"),
        (("aoi2022-planar", "aoi2022", "--at", "1 s"), "--at = '1 s': is a time"),
        (("aoi2022-planar",), "Missing argument 'OTHER'"),
    ):
        code, out, err = run("compare", *arguments)
        assert (code, out) == (2, "")
        assert said in err
