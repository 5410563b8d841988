"""Every reference key in the code leads to an entry in the one list of references."""

import re

from fixtures.paths import ROOT

KEY = re.compile(r"\[([A-Z][A-Za-z-]+(?:19|20)\d\d)\]")
LIST = ROOT / "docs/references.md"


def test_every_key_has_an_entry():
    listed = KEY.findall(LIST.read_text(encoding="utf-8"))
    lost = [
        f"{path.relative_to(ROOT)} cites [{key}]"
        for path in sorted((ROOT / "frictionid").rglob("*.py"))
        for key in KEY.findall(path.read_text(encoding="utf-8"))
        if key not in listed
    ]
    assert not lost, f"{LIST.relative_to(ROOT)} lacks an entry: {'; '.join(lost)}"


def test_the_list_is_in_order_and_without_repetition():
    listed = re.findall(r"^- \[([^]]+)\] ", LIST.read_text(encoding="utf-8"), re.M)
    assert len(listed) > 5
    assert listed == sorted(set(listed))
