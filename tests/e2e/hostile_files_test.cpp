// Uploads that mean harm: small files that unpack to gigabytes, or nest without end. One daemon
// stands all of them while an honest client streams.
#include "tests/fakes/hostile_files.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "daemon/calibration/calibration.hpp"
#include "tests/e2e/besieged.hpp"

namespace dtact::e2e {
namespace {

using ::testing::HasSubstr;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// `text` with `value` in place of what stands after "key = " on the first such line.
std::string with_value(std::string text, const std::string& key, const std::string& value) {
  const std::size_t at = text.find(key + " = ") + key.size() + 3;
  return text.replace(at, text.find('\n', at) - at, value);
}

/// The sensor's own calibration with this reference and the digest of it.
v1::UploadCalibration upload_with(const v1::CalibrationFiles& files, const std::string& png) {
  v1::UploadCalibration upload;
  upload.set_name("hostile");
  upload.set_reference_png(png);
  const std::string digest = '"' + calibration::sha256_hex(png) + '"';
  const std::string& toml = files.calibration_toml();
  const std::size_t reference = toml.find("[reference]");
  upload.set_calibration_toml(toml.substr(0, reference) +
                              with_value(toml.substr(reference), "sha256", digest));
  return upload;
}

class HostileFiles : public testing::Test {
 public:
  static Besieged* daemon;

 protected:
  static void SetUpTestSuite() { daemon = new Besieged; }
  static void TearDownTestSuite() {
    delete daemon;
    daemon = nullptr;
  }
  void SetUp() override {
    daemon->begin();
    begin_ = Clock::now();
  }

  /// The calibration that the daemon uses.
  [[nodiscard]] static v1::CalibrationFiles own() {
    return daemon->sensor().connect("hostile").calibration();
  }
  /// The sentence with which the daemon refuses; empty when it accepts.
  [[nodiscard]] std::string refusal(const v1::UploadCalibration& upload) const {
    client::Client client = daemon->sensor().connect("hostile");
    try {
      client.upload_calibration(upload);
      return "";
    } catch (const client::Refused& e) {
      return e.what();
    }
  }
  void end(const std::string& attack) {
    daemon->end(fmt::format("{}, {:.2f} s", attack, seconds_since(begin_)));
  }

  Clock::time_point begin_;
};
Besieged* HostileFiles::daemon = nullptr;

TEST_F(HostileFiles, TextChunksAreNotRead) {
  const v1::CalibrationFiles files = own();
  const std::string png = fakes::with_text_chunks(files.reference_png(), 400, 7'900'000);
  EXPECT_EQ(refusal(upload_with(files, png)), "");
  double listed_s = 0;
  {
    client::Client client = daemon->sensor().connect("hostile");
    const auto begin = Clock::now();
    EXPECT_EQ(client.calibrations().size(), 2U);
    listed_s = seconds_since(begin);
    client.activate_calibration(0);
  }
  end(fmt::format("a reference with 400 text chunks, {} bytes, listed in {:.3f} s", png.size(),
                  listed_s));
}

TEST_F(HostileFiles, APictureOfAnotherSizeIsNotDecoded) {
  EXPECT_THAT(refusal(upload_with(own(), fakes::grey16_png(8192, 8192))), HasSubstr("8192x8192"));
  end("a reference of 8192x8192 pixels");
}

TEST_F(HostileFiles, AFrameOfAnotherSizeIsNotDecoded) {
  v1::UploadCalibration upload = upload_with(own(), fakes::grey16_png(8192, 8192));
  std::string& toml = *upload.mutable_calibration_toml();
  const std::size_t frame = toml.find("[frame]");
  toml = toml.substr(0, frame) +
         with_value(with_value(toml.substr(frame), "width", "8192"), "height", "8192");
  EXPECT_THAT(refusal(upload), HasSubstr("8192x8192"));
  end("a calibration of 8192x8192 pixels");
}

TEST_F(HostileFiles, KeysNestOnlySoDeep) {
  v1::UploadCalibration upload;
  upload.set_name("deep");
  upload.set_calibration_toml(fakes::deep_toml(45'000));
  upload.set_reference_png("no PNG");
  EXPECT_THAT(refusal(upload), HasSubstr(":1: "));
  upload.set_calibration_toml("a = " + std::string(45'000, '[') + std::string(45'000, ']') + "\n");
  EXPECT_THAT(refusal(upload), HasSubstr(":1: "));
  end("keys and arrays 45,000 deep");
}

TEST_F(HostileFiles, AFileIsOnlySoWide) {
  v1::UploadCalibration upload;
  upload.set_name("wide");
  upload.set_reference_png("no PNG");
  std::string long_value;
  long_value.resize(15'900'000, 'x');
  for (const std::string& toml : {fakes::wide_toml(15'900'000), fakes::many_keys_toml(15'900'000),
                                  "a = \"" + long_value + "\"\n", fakes::wide_toml(4'000'000),
                                  fakes::many_keys_toml(4'000'000), fakes::wide_toml(520'000),
                                  fakes::many_keys_toml(300'000)}) {
    upload.set_calibration_toml(toml);
    EXPECT_THAT(refusal(upload), HasSubstr("upload wide:"));
  }
  end("uploads of 15.9 MB");
}

}  // namespace
}  // namespace dtact::e2e
