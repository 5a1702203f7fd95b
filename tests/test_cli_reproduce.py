"""What ``chilopod reproduce`` says of what it takes; what it computes is tested where that is computed."""

from chilopod.cli import main
from chilopod.paper.registry import load_sections
from helpers.command_line import printed


def test_the_help_lists_the_sections(capsys):
    assert main(["reproduce", "--help"]) == 0
    words = capsys.readouterr().out
    listed = words[words.index("repeated:") + len("repeated:") : words.index("--out")]
    assert "".join(listed.split()).rstrip(".").split(",") == [section.name for section in load_sections()]


def test_another_robot_is_refused_in_one_line(capsys):
    assert main(["reproduce", "--set", "body.mass=9 kg"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "body.mass=9 kg" in line
    assert "stability, bifurcation, branch, walk and turn take any robot" in line
    assert main(["reproduce", "my.toml"]) == 2
    assert "my.toml" in capsys.readouterr().err
    assert main(["reproduce", "--help"]) == 0
    assert "takes no robot and no --set" in " ".join(capsys.readouterr().out.split())


def test_a_page_that_is_no_report_is_not_replaced_and_the_json_has_robots_and_rows_of_that_size(capsys, tmp_path):
    page = tmp_path / "index.html"
    page.write_text("<title>mine</title>", encoding="utf-8")
    asked = ["reproduce", "--tiny", "--only", "modules", "--out", str(tmp_path)]
    assert main(asked) == 2
    assert "index.html" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [page]
    assert main([*asked, "--force"]) == 0
    found = printed(*asked, "--json")  # its own goes on
    assert (found["robot"], found["whole_robot"]) == ("aoi2022-planar", "aoi2022")
    (row,) = found["rows"]
    assert "7 to 7 modules" in row["quantity"]
