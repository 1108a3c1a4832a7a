#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include "daemon/pipeline/reference/reference_store.hpp"
#include "daemon/pipeline/reference/reference_writer.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/fakes/toy_sensor.hpp"

// A missing value ends the test by the exception of its access.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::pipeline {
namespace {

namespace fs = std::filesystem;

class StoreTest : public ::testing::Test {
 protected:
  StoreTest() { fs::remove_all(folder); }

 public:
  ~StoreTest() override { fs::remove_all(folder); }

 protected:
  StoredReference some() {
    StoredReference reference{fakes::kToyWidth, fakes::kToyHeight, fakes::toy_reference_q8(), {}};
    reference.light.brightness = 200;
    reference.light.gamma = 2.2;
    reference.light.leds[3] = {1, 2, 3};
    return reference;
  }
  auto load() { return load_reference(*calibration, fakes::kToyWidth, fakes::kToyHeight, folder); }

  fs::path folder = fakes::own_path();
  std::shared_ptr<calibration::Calibration> calibration = fakes::toy_calibration();
};

TEST_F(StoreTest, GivesBackWhatWasSaved) {
  save_reference(some(), *calibration, folder);
  const auto back = load();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->image_q8, some().image_q8);
  EXPECT_EQ(back->light, some().light);
}

TEST_F(StoreTest, NothingStoredIsNoError) { EXPECT_FALSE(load()); }

TEST_F(StoreTest, AnotherCalibrationsReferenceIsNotUsed) {
  save_reference(some(), *calibration, folder);
  calibration->origin.created = "2026-02-02T00:00:00Z";  // the same name, made anew
  EXPECT_FALSE(load());
  calibration = fakes::toy_calibration();
  calibration->name = "other";
  EXPECT_FALSE(load());
}

TEST_F(StoreTest, AnotherFrameSizeIsNotUsed) {
  save_reference(some(), *calibration, folder);
  EXPECT_TRUE(load_reference(*calibration, 160, 120, folder));
  EXPECT_FALSE(load_reference(*calibration, 320, 120, folder));
  EXPECT_FALSE(load_reference(*calibration, 160, 240, folder));
}

TEST_F(StoreTest, HalvesOfDifferentAgesAreNoticed) {
  save_reference(some(), *calibration, folder);
  const std::string old_png = base::read_file(folder / "reference.png");
  StoredReference newer = some();
  newer.image_q8[0] = 7;
  save_reference(newer, *calibration, folder);
  base::write_file_atomically(folder / "reference.png", old_png);
  try {
    (void)load();
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("reference.png"), std::string::npos) << e.what();
  }
}

TEST_F(StoreTest, DamageNamesFileAndFix) {
  save_reference(some(), *calibration, folder);
  std::ofstream(folder / "reference.toml") << "version = 1\nlight =\n";
  try {
    (void)load();
    FAIL();
  } catch (const std::runtime_error& e) {
    const std::string what = e.what();
    EXPECT_NE(what.find("reference.toml:2: "), std::string::npos) << what;
    EXPECT_NE(what.find("delete it"), std::string::npos) << what;
  }
}

TEST_F(StoreTest, TheWriterWritesBehind) {
  base::BackgroundThread thread("side");
  ReferenceWriter writer(fakes::kToyWidth, fakes::kToyHeight, folder, thread);
  thread.start();
  EXPECT_TRUE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
  thread.stop();  // writes the offered reference
  EXPECT_EQ(writer.message(), "");
  ASSERT_TRUE(load());
  EXPECT_EQ(calibration.use_count(), 1);
}

TEST_F(StoreTest, TheWriterSaysWhatFailed) {
  std::ofstream(folder.string()) << "a file where the folder should be";
  base::BackgroundThread thread("side");
  ReferenceWriter writer(fakes::kToyWidth, fakes::kToyHeight, folder, thread);
  thread.start();
  EXPECT_TRUE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
  thread.stop();
  EXPECT_NE(writer.message().find("make the state folder writable"), std::string::npos)
      << writer.message();
  std::filesystem::remove(folder);  // fixed
  thread.start();
  EXPECT_TRUE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
  thread.stop();
  EXPECT_EQ(writer.message(), "");
}

TEST_F(StoreTest, WithoutAFolderNothingIsKept) {
  base::BackgroundThread thread("side");
  ReferenceWriter writer(fakes::kToyWidth, fakes::kToyHeight, {}, thread);
  EXPECT_TRUE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
  EXPECT_TRUE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
}

TEST_F(StoreTest, ABusyWriterRefuses) {
  base::BackgroundThread thread("side");
  ReferenceWriter writer(fakes::kToyWidth, fakes::kToyHeight, folder,
                         thread);  // not started: stays busy
  EXPECT_TRUE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
  EXPECT_FALSE(writer.offer(fakes::toy_reference_q8(), {}, calibration));
}

}  // namespace
}  // namespace dtact::pipeline
// NOLINTEND(bugprone-unchecked-optional-access)
