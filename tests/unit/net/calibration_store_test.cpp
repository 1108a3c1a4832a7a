#include "daemon/net/calibration_store.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "hal/base/atomic_file.hpp"

namespace dtact::net {
namespace {

namespace fs = std::filesystem;

class Store : public testing::Test {
 protected:
  Store() {
    std::string name = (fs::temp_directory_path() / "dtact-store-XXXXXX").string();
    state_ = ::mkdtemp(name.data());
  }
  ~Store() override { fs::remove_all(state_); }

  fs::path state_;
};

TEST_F(Store, IsEmptyAtFirst) {
  EXPECT_EQ(FolderCalibrationStore::current(state_), fs::path());
  FolderCalibrationStore store(state_, {});
  EXPECT_THROW((void)store.read(), std::runtime_error);
}

TEST_F(Store, KeepsFilesUnderTheirName) {
  FolderCalibrationStore store(state_, {});
  store.keep({"ball", "a toml", "a png"});
  const auto folder = FolderCalibrationStore::current(state_);
  EXPECT_EQ(folder.filename(), "ball");
  EXPECT_EQ(base::read_file(folder / "calibration.toml"), "a toml");
  EXPECT_EQ(base::read_file(folder / "reference.png"), "a png");
  EXPECT_EQ(fs::canonical(state_ / "calibration"), fs::canonical(folder));
  const auto files = store.read();
  EXPECT_EQ(files.name, "ball");
  EXPECT_EQ(files.toml, "a toml");
  EXPECT_EQ(files.png, "a png");
}

TEST_F(Store, ReadsTheFolderInUse) {
  const fs::path folder = state_ / "elsewhere";
  fs::create_directory(folder);
  base::write_file_atomically(folder / "calibration.toml", "t");
  base::write_file_atomically(folder / "reference.png", "p");
  FolderCalibrationStore store(state_, folder);
  EXPECT_EQ(store.read().name, "elsewhere");
  EXPECT_EQ(store.read().png, "p");
}

TEST_F(Store, KeepsTheOneBeforeAlsoUnderTheSameName) {
  FolderCalibrationStore store(state_, {});
  store.keep({"ball", "1", "p"});
  const auto first = FolderCalibrationStore::current(state_);
  store.keep({"ball", "2", "p"});
  const auto second = FolderCalibrationStore::current(state_);
  EXPECT_NE(first, second);
  EXPECT_EQ(base::read_file(first / "calibration.toml"), "1");
  EXPECT_EQ(base::read_file(second / "calibration.toml"), "2");
  store.keep({"pins", "3", "p"});
  EXPECT_FALSE(fs::exists(first));
  EXPECT_TRUE(fs::exists(second));
  EXPECT_EQ(FolderCalibrationStore::current(state_).filename(), "pins");
}

TEST_F(Store, GoesOnAfterARestart) {
  FolderCalibrationStore(state_, {}).keep({"ball", "1", "p"});
  const auto first = FolderCalibrationStore::current(state_);
  FolderCalibrationStore again(state_, first);
  again.keep({"ball", "2", "p"});
  EXPECT_TRUE(fs::exists(first));
  EXPECT_EQ(again.read().toml, "2");
}

TEST_F(Store, FailsWhereItCannotWrite) {
  FolderCalibrationStore store(state_ / "no", {});
  base::write_file_atomically(state_ / "no", "a file");
  EXPECT_THROW(store.keep({"ball", "1", "p"}), std::exception);
}

TEST_F(Store, RefusesWhatIsNoCalibration) {
  FolderCalibrationStore store(state_, {});
  EXPECT_THROW((void)store.check({"ball", "this is no toml", "this is no png"}),
               std::runtime_error);
  EXPECT_EQ(FolderCalibrationStore::current(state_), fs::path());
}

}  // namespace
}  // namespace dtact::net
