#include "hal/files/toml_bounds.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"
#include "tests/fakes/hostile_files.hpp"

namespace dtact::tomlfile {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string refusal(const std::string& text) {
  try {
    (void)check_bounds(text, "x.toml");
    return "";
  } catch (const std::runtime_error& e) {
    return e.what();
  }
}

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

TEST(TomlBounds, AFileHasSoManyBytes) {
  const std::string most = "#" + std::string(kMaxBytes - 1, 'x');
  EXPECT_EQ(refusal(most), "");
  EXPECT_EQ(refusal(most + "x"), "x.toml:1: the file has 4194305 bytes; at most 4194304 are read");
}

TEST(TomlBounds, AKeyHasSoManyParts) {
  const std::string what = "a key has more than 16 parts";
  EXPECT_EQ(refusal(fakes::deep_toml(15)), "");
  EXPECT_THAT(refusal("\n\n" + fakes::deep_toml(16)), StartsWith("x.toml:3: " + what));
  EXPECT_THAT(refusal("[" + repeated("a .\t", 16) + "a]"), HasSubstr(what));
  EXPECT_THAT(refusal("[[" + repeated("\"b\".", 16) + "a]]"), HasSubstr(what));
  EXPECT_THAT(refusal("a = {b = 1, " + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = [\n{" + fakes::deep_toml(16)), HasSubstr(what));
  // Behind what only looks like the begin of a string or comment.
  EXPECT_THAT(refusal("a = '\\'\n" + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = \"\\\"\" # \"\"\"\n" + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = \"\"\n" + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = \"\"\"b\\\"\"\"\"\n" + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = \"\"\"\"\"b\"\"\"\"\"\n" + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = '''\n'' '''''\n" + fakes::deep_toml(16)), HasSubstr(what));
  EXPECT_THAT(refusal("a = \"not ended\n" + fakes::deep_toml(16)), HasSubstr(what));
}

TEST(TomlBounds, AValueNestsSoDeep) {
  const std::string what = "a value has more than 16 arrays and tables within each other";
  EXPECT_EQ(refusal("a = " + repeated("[", 16) + repeated("]", 16)), "");
  EXPECT_THAT(refusal("a = " + repeated("[", 17)), HasSubstr(what));
  EXPECT_THAT(refusal("a = " + repeated("{b = ", 17)), HasSubstr(what));
  EXPECT_THAT(refusal("a = " + repeated("[{b=", 9)), HasSubstr(what));
  // One after another they do not nest.
  EXPECT_EQ(refusal("a = [" + repeated("[[1], {b = [1]}],\n", 100) + "]\n" +
                    repeated("[[c]]\nd = {e = {}}\n", 100)),
            "");
}

TEST(TomlBounds, AFileHasSoManyKeysAndValues) {
  EXPECT_THAT(refusal(fakes::many_keys_toml(2'000'000)), HasSubstr("more than 32768 keys"));
  EXPECT_THAT(refusal(repeated("[[a]]\n", 20'000)), HasSubstr("keys"));
  EXPECT_THAT(refusal(repeated("a.b.c.d.e.f.g.h=1\n", 5'000)), HasSubstr("keys"));
  EXPECT_THAT(refusal("a=[" + repeated("{b=1},", 40'000)), HasSubstr("keys"));
  EXPECT_THAT(refusal(fakes::wide_toml(1'000'000)), HasSubstr("more than 262144 values"));
  EXPECT_THAT(refusal("a=[" + repeated("[],", 140'000)), HasSubstr("values"));
  EXPECT_EQ(refusal(fakes::wide_toml(520'000)), "");
  EXPECT_EQ(refusal("a = [" + repeated("-16383, ", 130'000) + "]\n"), "");
}

TEST(TomlBounds, AWordIsSoLong) {
  const std::string most(kMaxWord, 'x');
  EXPECT_EQ(refusal(most + " = 1"), "");
  EXPECT_THAT(refusal(most + "x = 1"), HasSubstr("a word has more than 4096 bytes"));
  EXPECT_THAT(refusal("a = \"" + most + "\""), HasSubstr("a string has more than 4096 bytes"));
  EXPECT_THAT(refusal("a = '''" + repeated("b\n", 2100) + "'''"), HasSubstr("a string"));
  EXPECT_THAT(refusal("a = \"\\"), "");
  EXPECT_THAT(refusal("a = \"\"\""), "");
}

// The parser's own check of a key is an assertion.
TEST(TomlBounds, ControlCharactersAreRefused) {
  EXPECT_EQ(refusal(std::string("a = 1\n[\0a]", 10)),
            "x.toml:2: holds a control character, U+0000, which no TOML may");
  EXPECT_THAT(refusal("# \x1b[31m"), HasSubstr("U+001B"));
  EXPECT_THAT(refusal("a = \"\x7f\""), HasSubstr("U+007F"));
  EXPECT_EQ(refusal("a = \"ä\"\t# ß\r\n"), "");
}

TEST(TomlBounds, WhatStringsAndCommentsHoldDoesNotCount) {
  const std::string marks = repeated("[.{=,", 40);
  EXPECT_EQ(refusal("# " + marks + "\na = \"" + marks + "\" # " + marks + "\nb = '" + marks +
                    "'\nc = '''\n" + marks + "'''\n\"" + marks + "\" = 1\n[\"" + marks + "\"]\n"),
            "");
}

TEST(TomlBounds, AreCheckedBeforeTheParser) {
  EXPECT_THROW((void)parse(fakes::deep_toml(45'000), "x.toml"), std::runtime_error);
  EXPECT_EQ(parse("a.b = [1, 2]", "x.toml")["a"]["b"].as_array()->size(), 2U);
}

TEST(TomlBounds, FilesOfTheProjectAreFarFromThem) {
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(DTACT_CONFIG_FOLDER)) {
    if (entry.path().extension() != ".toml") continue;
    const std::string text = base::read_file(entry.path());
    EXPECT_EQ(refusal(text), "") << entry.path();
    EXPECT_LT(text.size(), kMaxBytes / 20) << entry.path();
    ++files;
  }
  EXPECT_GT(files, 10);
}

}  // namespace
}  // namespace dtact::tomlfile
