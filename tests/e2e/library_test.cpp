// The installed C++ library as its users build with it: the example of clients/cpp/README.md, with
// CMake and with pkg-config, against a daemon on the simulated sensor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <sstream>

#include "hal/base/atomic_file.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// What `command` prints; fails the test when it fails.
std::string output_of(const std::string& command) {
  std::string output;
  EXPECT_EQ(run_program({"/bin/sh", "-ec", command}, &output), 0) << command << '\n' << output;
  return output;
}

/// The block of a page that begins with ```LANGUAGE.
std::string block(const std::string& language,
                  const char* page = DTACT_SOURCE_DIR "/clients/cpp/README.md") {
  const std::string text = base::read_file(page);
  const std::string fence = "```" + language + "\n";
  const std::size_t begin = text.find(fence) + fence.size();
  return text.substr(begin, text.find("```", begin) - begin);
}

/// The library in a prefix of its own, and the example beside it.
class Library : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TempFolder>();
    for (const char* component : {"libdtact", "libdtact-dev"}) {
      output_of("cmake --install '" DTACT_BINARY_DIR "' --prefix '" + prefix().string() +
                "' --component " + component);
    }
    fs::create_directory(example());
    std::ofstream(example() / "example.cpp") << block("cpp");
    std::ofstream(example() / "CMakeLists.txt") << block("cmake");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static fs::path prefix() { return folder_->path() / "prefix"; }
  static fs::path example() { return folder_->path() / "example"; }
  static fs::path libraries() {
    return fs::exists(prefix() / "lib/libdtact.so") ? prefix() / "lib"
                                                    : prefix() / DTACT_LIBRARY_DIR;
  }

  static void expect_depth(const std::string& program) {
    const Sensor sensor(scene_file("calibrate_ball.toml"));
    const std::string output =
        output_of("LD_LIBRARY_PATH='" + libraries().string() + "' '" + program +
                  "' 127.0.0.1:" + std::to_string(sensor.daemon->port()));
    std::istringstream lines(output);
    const std::regex form(R"(frame \d+: -?\d[\d.e-]* mm in the middle, deepest \d[\d.e-]* mm)");
    int frames = 0;
    for (std::string line; std::getline(lines, line); ++frames) {
      EXPECT_TRUE(std::regex_match(line, form)) << line;
    }
    EXPECT_EQ(frames, 10) << output;
  }

 private:
  static std::unique_ptr<TempFolder> folder_;
};
std::unique_ptr<TempFolder> Library::folder_;

TEST_F(Library, IsFoundByCMake) {
  const std::string build = (example() / "build").string();
  output_of("cmake -S '" + example().string() + "' -B '" + build + "' -DCMAKE_PREFIX_PATH='" +
            prefix().string() +
            "' -DCMAKE_CXX_COMPILER='" DTACT_COMPILER
            "' -DCMAKE_CXX_FLAGS='-Wall -Wextra -Wpedantic -Werror " DTACT_FLAGS "'");
  output_of("cmake --build '" + build + "'");
  expect_depth(build + "/example");
}

TEST_F(Library, IsFoundByPkgConfig) {
  const std::string program = (example() / "with_pkg_config").string();
  output_of("cd '" + example().string() + "'; export PKG_CONFIG_PATH='" +
            (libraries() / "pkgconfig").string() +
            "'; '" DTACT_COMPILER "' " DTACT_FLAGS " -std=c++20 -o '" + program +
            "' example.cpp $(pkg-config --cflags --libs dtact)");
  EXPECT_THAT(output_of("readelf -d '" + program + "'"), HasSubstr("[libdtact.so.1]"));
  expect_depth(program);
}

// README.md's example, on what the package installs, and on a sensor that is not calibrated.
TEST_F(Library, TheFirstExampleShowsDepthOrSaysWhyNot) {
  std::string source = block("cpp", DTACT_SOURCE_DIR "/README.md");
  const std::string where = "{.host = \"localhost\"}";
  ASSERT_NE(source.find(where), std::string::npos);
  source.replace(source.find(where), where.size(), "{.host = argv[1]}");
  source.replace(source.find("main()"), 6, "main(int, char** argv)");
  std::ofstream(example() / "first.cpp") << source;
  const std::string program = (example() / "first").string();
  output_of("cd '" + example().string() + "'; export PKG_CONFIG_PATH='" +
            (libraries() / "pkgconfig").string() +
            "'; '" DTACT_COMPILER "' " DTACT_FLAGS " -std=c++20 -o '" + program +
            "' first.cpp $(pkg-config --cflags --libs dtact)");
  const auto run = [&](const Sensor& sensor, std::string* output) {
    return run_program({"/bin/sh", "-ec",
                        "LD_LIBRARY_PATH='" + libraries().string() + "' exec '" + program +
                            "' 127.0.0.1:" + std::to_string(sensor.daemon->port())},
                       output);
  };
  std::string output;
  const std::string shipped = scene_file("../simulated").string();
  EXPECT_EQ(run(Sensor({}, false, {"camera.sim.calibration=" + shipped}), &output), 0) << output;
  EXPECT_TRUE(std::regex_match(output, std::regex(R"(\d[\d.e-]* mm deep\n)"))) << output;
  EXPECT_EQ(run(Sensor({}, false), &output), 1);
  EXPECT_THAT(output, HasSubstr("no depth: No calibration: dtact-calibrate guided"));
}

// Exported names without a namespace: only the version's own.
TEST_F(Library, ExportsItsOwnNamesOnly) {
  const std::string names =
      output_of("nm -DC --defined-only '" + (libraries() / "libdtact.so").string() + "'");
  EXPECT_THAT(names, AllOf(HasSubstr(" T dtact::client::Client::next("),
                           HasSubstr(" V typeinfo for dtact::client::Refused@"),
                           HasSubstr(" T dtact::v1::Frame::Frame("),
                           Not(HasSubstr("dtact::client::Session"))));
  std::istringstream lines(names);
  const std::regex own(
      R"([0-9a-f]+ . ((typeinfo( name)? for |vtable for )?dtact::(client|v1)::.*|DTACT_1))");
  for (std::string line; std::getline(lines, line);) {
    EXPECT_TRUE(std::regex_match(line, own)) << line;
  }
}

TEST_F(Library, ItsHeadersKnowNoOtherLibraryThanProtobuf) {
  const std::regex include(R"(#include ["<]([^">]+)[">])");
  int headers = 0;
  for (const auto& file : fs::directory_iterator(prefix() / "include/dtact")) {
    ++headers;
    const std::string text = base::read_file(file.path());
    for (std::sregex_iterator match(text.begin(), text.end(), include), end; match != end;
         ++match) {
      const std::string name = (*match)[1];
      EXPECT_TRUE(name.find('/') == std::string::npos || name.starts_with("google/protobuf/") ||
                  fs::exists(prefix() / "include" / name))
          << file.path() << " includes " << name;
    }
  }
  EXPECT_EQ(headers, 8);
}

}  // namespace
}  // namespace dtact::e2e
