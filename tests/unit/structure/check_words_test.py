#!/usr/bin/env python3
"""The check of words finds refused ones."""
import pathlib
import unittest

from check_words import Rules, complaints, words_of

RULES = Rules("# a comment\n"
              "name\tuntouched\treference\n"
              "name\t(?<!\\w )most \\w.*\tmax\n"
              "text\tso much a second\tper second\n"
              "both\tstrangers?\tunauthenticated client\n"
              "allow\ttests/install/\tstranger_vm\tthe name of a virtual machine\n")


def found(text, path="a/b.cpp"):
    return list(complaints(path, text, RULES))


class Words(unittest.TestCase):
    def test_identifiers_are_split_into_words(self):
        self.assertEqual(words_of("kMostCells"), "most cells")
        self.assertEqual(words_of("untouched_image_"), "untouched image")
        self.assertEqual(words_of("HEALTH_IMAGE_DARK"), "health image dark")

    def test_plain_words_pass(self):
        self.assertEqual(found("int kMaxCells = 3;  // the reference image, at most this much\n"), [])

    def test_names_in_every_spelling(self):
        for name in ("UntouchedImage", "untouched_image", "kUntouched_mm", "isUntouched", "NO_UNTOUCHED"):
            self.assertEqual(found(f"\nint {name};\n"), [f'a/b.cpp:2: {name} has "untouched": reference'])

    def test_a_bound_is_a_maximum_only_at_the_front(self):
        self.assertEqual(len(found("kMostCells most_cells")), 2)
        self.assertEqual(found("at_most_once kMost"), [])

    def test_text_is_searched_in_whole_words_and_any_case(self):
        self.assertEqual(found("// So much a second.\n"), ['a/b.cpp:1: "So much a second": per second'])
        self.assertEqual(found("// a strangerer estranger\n"), [])

    def test_a_file_is_named_too(self):
        self.assertEqual(found("", "daemon/untouched_image.cpp"),
                         ['daemon/untouched_image.cpp: the name has "untouched": reference'])

    def test_an_exception_holds_for_its_folder_alone(self):
        self.assertEqual(found("stranger_vm", "tests/install/a.sh"), [])
        self.assertEqual(len(found("stranger_vm", "tests/unit/a.sh")), 1)

    def test_a_line_of_the_list_that_is_none_is_refused(self):
        with self.assertRaisesRegex(ValueError, "words.txt:1"):
            Rules("name\tuntouched\n")

    def test_the_list_itself_is_read(self):
        text = (pathlib.Path(__file__).parent / "words.txt").read_text(encoding="utf-8")
        rules = Rules(text)
        self.assertGreater(len(rules.names), 15)
        self.assertTrue(list(complaints("a.hpp", "class UntouchedImage; constexpr int kMostCells = 3; // a remedy", rules)))


if __name__ == "__main__":
    unittest.main()
