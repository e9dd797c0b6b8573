"""Links of the documents lead to files and headings that are there, and the site names every document.

    links_test.py
"""

import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("*/README.md")])


def without_code(text):
    text = re.sub(r"^(```+).*?^\1\s*$", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", lambda code: "x" * len(code[0]), text)


def anchors(path):
    """Names of the headings as forges and the site make them."""
    names = {}
    text = re.sub(r"^(```+).*?^\1\s*$", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
    for heading in re.findall(r"^#+ +(.*?)\s*$", text, re.MULTILINE):
        heading = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        seen = names.setdefault(name, 0)
        names[name] += 1
        if seen:
            names[f"{name}-{seen}"] = 1
    return set(names)


class Links(unittest.TestCase):
    def test_lead_to_files_and_headings(self):
        checked = 0
        for document in DOCUMENTS:
            for target in re.findall(r"\]\(\s*<?([^()\s>]+)>?[^()]*\)", without_code(document.read_text())):
                if re.match(r"[a-z]+:", target):
                    continue
                checked += 1
                name, _, anchor = target.partition("#")
                file = (document.parent / name).resolve() if name else document
                where = f"{document.relative_to(ROOT)}: {target}"
                self.assertTrue(file.exists(), f"{where}: there is no such file")
                self.assertTrue(file.is_relative_to(ROOT), f"{where} leads out of the project")
                if anchor:
                    self.assertIn(anchor, anchors(file), f"{where}: there is no such heading")
        self.assertGreater(checked, 100)

    def test_sources_name_documents_that_are_there(self):
        for folder in ("src", "python", "script", "experiments", "benchmarks", "tests", "fuzz"):
            for file in (ROOT / folder).rglob("*"):
                if "node_modules" in file.parts or not file.is_file() or file.suffix in (".pyc", ".json"):
                    continue
                for name in re.findall(r"\bdocs/(\w+\.md)\b", file.read_text(errors="ignore")):
                    self.assertTrue((ROOT / "docs" / name).exists(), f"{file.relative_to(ROOT)}: docs/{name}")

    def test_the_site_has_every_document(self):
        entries = set((ROOT / "docs/site/index.md").read_text().split())
        for document in (ROOT / "docs").glob("*.md"):
            self.assertIn(f"docs/{document.stem}", entries)


if __name__ == "__main__":
    unittest.main()
