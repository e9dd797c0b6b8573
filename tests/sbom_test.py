"""script/sbom on the built program: valid SPDX 2.3 as far as its schema asks, and nothing left out.

  /usr/bin/python3 tests/sbom_test.py PROGRAM
"""

import json
import re
import subprocess
import sys
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ""


class Sbom(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.text = subprocess.run([ROOT / "script/sbom", PROGRAM], capture_output=True, text=True, check=True).stdout
        cls.document = json.loads(cls.text)
        cls.packages = {p["SPDXID"]: p for p in cls.document["packages"]}

    def test_has_what_the_schema_asks(self):
        for key in ("spdxVersion", "dataLicense", "SPDXID", "name", "documentNamespace", "creationInfo"):
            self.assertIn(key, self.document)
        self.assertRegex(self.document["creationInfo"]["created"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        self.assertEqual(len(self.packages), len(self.document["packages"]), "ids must differ")
        for identifier, package in self.packages.items():
            self.assertRegex(identifier, r"^SPDXRef-[A-Za-z0-9.-]+$")
            self.assertTrue(package["versionInfo"])
            self.assertTrue(package["licenseDeclared"])

    def test_relations_name_what_is_there(self):
        for relation in self.document["relationships"]:
            self.assertIn(relation["spdxElementId"], {*self.packages, "SPDXRef-DOCUMENT"})
            self.assertIn(relation["relatedSpdxElement"], self.packages)
        related = {r["relatedSpdxElement"] for r in self.document["relationships"]}
        self.assertEqual(related, set(self.packages))

    def test_every_licence_is_spdx_or_explained(self):
        explained = {e["licenseId"] for e in self.document["hasExtractedLicensingInfos"]}
        for package in self.packages.values():
            for word in re.findall(r"LicenseRef-[A-Za-z0-9.-]+", package["licenseDeclared"]):
                self.assertIn(word, explained)

    def test_names_every_library_that_is_loaded(self):
        known = subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=True).stdout
        owners = set()
        for name in ("libopencv_core.so", "libembree3.so", "libassimp.so", "libopencv_imgcodecs.so", "libpoppler.so"):
            path = re.search(rf"=> (\S*/{re.escape(name)}\.\S+)", known)
            self.assertTrue(path, name)
            real = str(Path(path[1]).resolve())
            owners.add(subprocess.run(["dpkg-query", "-S", "*" + Path(real).name], capture_output=True, text=True,
                                      check=True).stdout.split(":")[0])
        names = {p["name"] for p in self.packages.values()}
        self.assertLessEqual(owners | {"three", "libceres-dev", "libeigen3-dev", "libcli11-dev", "nlohmann-json3-dev"}, names)

    def test_says_which_licences_the_gravest_libraries_have(self):
        poppler = [p for p in self.packages.values() if p["name"].startswith("libpoppler")]
        self.assertTrue(poppler)
        self.assertIn("GPL", poppler[0]["licenseDeclared"])


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main()
