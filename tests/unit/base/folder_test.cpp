#include "hal/base/folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::base {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

TEST(Folder, NumbersInNamesAreInTheOrderOfTheirValues) {
  std::vector<std::string> names{"frame10",  "frame9b",
                                 "frame",    "frame1",
                                 "1_2",      "1_10",
                                 "0",        "00",
                                 "a",        "frame09",
                                 "frame9a0", "9999999999999999999999",
                                 "",         "10000000000000000000000"};
  std::ranges::sort(names, natural_less);
  EXPECT_THAT(names, ElementsAre("", "0", "00", "1_2", "1_10", "9999999999999999999999",
                                 "10000000000000000000000", "a", "frame", "frame1", "frame09",
                                 "frame9a0", "frame9b", "frame10"));
  for (const std::string& name : names) EXPECT_FALSE(natural_less(name, name)) << name;
}

TEST(Folder, HiddenFilesAreLeftOut) {
  const fs::path folder = fakes::own_path();
  fs::create_directories(folder);
  for (const char* name : {"10.png", "._10.png", "2.png", ".DS_Store", "1.png"}) {
    write_file_atomically(folder / name, "x");
  }
  EXPECT_THAT(visible_files(folder),
              ElementsAre(folder / "1.png", folder / "2.png", folder / "10.png"));
  fs::remove_all(folder);
  EXPECT_THROW((void)visible_files(folder), fs::filesystem_error);
}

}  // namespace
}  // namespace dtact::base
