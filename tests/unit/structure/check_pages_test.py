#!/usr/bin/env python3
"""The check of the pages' links finds broken ones."""
import pathlib
import tempfile
import unittest

from check_pages import complaints


class Pages(unittest.TestCase):
    def found(self, files):
        with tempfile.TemporaryDirectory() as folder:
            top = pathlib.Path(folder)
            for name, text in files.items():
                (top / name).parent.mkdir(parents=True, exist_ok=True)
                (top / name).write_text(text, encoding="utf-8")
            return list(complaints(top))

    def test_files_folders_headings_and_addresses_pass(self):
        self.assertEqual(self.found({
            "README.md": "[a](tests/A.md) ![b](b.png) [c](tests) [d](#two-words)\n## Two words\n"
                         "[e](https://example.org/x) [f](tests/A.md#daemons-end)\n",
            "tests/A.md": "# Daemon's end\n[up](../README.md)\n",
            "b.png": "",
        }), [])

    def test_a_missing_file_is_named_with_its_page(self):
        self.assertEqual(self.found({"tests/A.md": "[x](README.md)\n", "README.md": ""}),
                         ["tests/A.md: links to README.md, which is not there"])

    def test_a_missing_picture(self):
        self.assertEqual(self.found({"A.md": "![x](x.png)\n"}), ["A.md: links to x.png, which is not there"])

    def test_a_missing_heading(self):
        self.assertEqual(self.found({"A.md": "[x](#there)\n```\n# There\n```\n"}),
                         ["A.md: links to #there, a heading that is not there"])

    def test_code_holds_no_links(self):
        self.assertEqual(self.found({"A.md": "    a[i](j)\n\n```cpp\nf[i](j)\n```\n"}), [])

    def test_what_is_built_is_left_out(self):
        self.assertEqual(self.found({"build/A.md": "[x](x)\n", "debian/dtactd/A.md": "[x](x)\n",
                                     ".cache/A.md": "[x](x)\n"}), [])


if __name__ == "__main__":
    unittest.main()
