// The session over libcamera's own virtual camera, which libcamera has since 0.4 where it was built
// with it: Debian 13 has. It needs a file below /usr/share; the test makes it in a file system of
// its own process.
#include <gtest/gtest.h>
#include <libcamera/camera_manager.h>
#include <sched.h>
#include <sys/mount.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <new>

#include "hal/libcamera/session.hpp"
#include "hal/live/live_camera.hpp"
#include "hal/live/source.hpp"
#include "tests/unit/libcamera/kernel_double.hpp"

// libcamera 0.4.0's virtual camera does not initialise a frame's metadata (virtual.cpp:
// queueRequestDevice()), so this program allocates zeroed memory. Not inlined: gcc would report
// a mismatch of new and delete.
[[gnu::noinline]] void* operator new(std::size_t size) {
  if (void* memory = std::calloc(1, size); memory != nullptr) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t /*size*/) noexcept {
  std::free(memory);
}

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

constexpr std::array kNoHeap{"/dev/null"};

/// PipelineHandlerVirtual::match() reads it (pipeline_handler.cpp: configurationFile()).
bool describe_camera() {
  if (::unshare(CLONE_NEWNS) != 0 ||
      ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      ::mount("tmpfs", "/usr/share", "tmpfs", 0, nullptr) != 0) {
    return false;
  }
  std::filesystem::create_directories("/usr/share/libcamera/pipeline/virtual");
  std::ofstream("/usr/share/libcamera/pipeline/virtual/virtual.yaml")
      << "\"bars\":\n"
         "  supported_formats:\n"
         "  - width: 800\n"
         "    height: 600\n"
         "    frame_rates:\n"
         "    - 30\n"
         "    - 60\n"
         "  test_pattern: \"bars\"\n"
         "  location: \"CameraLocationFront\"\n"
         "  model: \"bars\"\n";
  return true;
}

class VirtualCamera : public testing::Test {
 protected:
  void SetUp() override {
    libcamera_test::new_kernel();
    static const bool described = describe_camera();
    if (!described) GTEST_SKIP() << "needs a file system of its own: run as root";
    ASSERT_EQ(manager_.start(), 0);
    camera_ = manager_.get("bars");
    if (!camera_) {
      GTEST_SKIP() << "libcamera " << lc::CameraManager::version() << " has no virtual camera";
    }
  }
  void TearDown() override {
    camera_.reset();
    manager_.stop();
  }

  [[nodiscard]] static CameraConfig config(double fps) {
    CameraConfig c;
    c.backend = "libcamera";
    c.width = 800;
    c.height = 600;
    c.fps = fps;
    return c;
  }
  [[nodiscard]] std::shared_ptr<Session> open(double fps) {
    const DmaHeap heap(kNoHeap);
    return std::make_shared<Session>(nullptr, camera_, config(fps), PhotometricLock({}, fps),
                                     &heap);
  }

  lc::CameraManager manager_;
  std::shared_ptr<lc::Camera> camera_;
};

TEST_F(VirtualCamera, StreamsFromTheHeapAndStretchesItsLimitedRange) {
  live::LiveCamera camera(config(60), "libcamera", "bars", [this]() -> live::Opened {
    const std::shared_ptr<Session> session = open(60);
    return {session, "bars", session->pixel_format(), session->controls()};
  });
  camera.start();
  EXPECT_EQ(libcamera_test::kernel().allocated, 4U);
  Frame frame;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(camera.grab(frame, std::chrono::seconds(10)), GrabStatus::ok)
        << i << ": " << camera.report().fix << camera.report().damage.flagged << " flagged, "
        << camera.report().damage.too_short << " short";
    // Eight bars from white to black that move to the left.
    const std::span row(frame.luma().row(300), 800);
    EXPECT_EQ(*std::ranges::min_element(row), 0);
    EXPECT_EQ(*std::ranges::max_element(row), 255);
  }
  frame.reset();
  EXPECT_EQ(camera.report().damaged, 0U);
  EXPECT_EQ(camera.info().pixel_format, "NV12");
  // Each frame that was read has been bracketed.
  EXPECT_GE(libcamera_test::kernel().syncs.size(), 200U);
  const std::vector<CameraControl> controls = camera.info().controls;
  const auto range = std::ranges::find(controls, "full_range", &CameraControl::name);
  ASSERT_NE(range, controls.end());
  EXPECT_EQ(range->value, 0);
}

TEST_F(VirtualCamera, AFrameThatCannotBeReadSafelyIsDamaged) {
  const std::shared_ptr<Session> session = open(60);
  libcamera_test::kernel().failures = {EIO};
  live::FilledBuffer filled;
  while (session->dequeue(filled) == live::DequeueStatus::none) {
    session->wait(std::numeric_limits<std::int64_t>::max() / 2);
  }
  EXPECT_TRUE(filled.flagged);
  ASSERT_TRUE(session->enqueue(filled.index));
  while (session->dequeue(filled) == live::DequeueStatus::none) {
    session->wait(std::numeric_limits<std::int64_t>::max() / 2);
  }
  EXPECT_FALSE(filled.flagged);
}

// It reports no exposure; that its frames are taken shows in their brackets.
TEST_F(VirtualCamera, TakesFramesToChangeBeforeUse) {
  const std::shared_ptr<Session> session = open(60);
  std::vector<CameraControl> controls = session->controls();
  CameraSettings settings = session->settings();
  const std::size_t before = libcamera_test::kernel().syncs.size();
  session->change_before_use({.exposure_us = 5000, .gain = {}}, controls, settings);
  EXPECT_GE(libcamera_test::kernel().syncs.size() - before, 2U * kSettlingFrames);
}

TEST_F(VirtualCamera, RefusesARateThatTheCameraDoesNotHave) {
  try {
    (void)open(120);
    FAIL();
  } catch (const live::ModeError& e) {
    EXPECT_NE(std::string(e.what()).find("bars gives at most 60.0 frames a second at 800x600"),
              std::string::npos)
        << e.what();
  }
}

TEST_F(VirtualCamera, GoesOnWithoutAHeap) {
  libcamera_test::kernel().has_memory = false;
  try {
    (void)open(60);  // libcamera allocates once here
  } catch (const live::DeviceError& e) {
    EXPECT_NE(std::string(e.what()).find("cannot get buffers of bars"), std::string::npos)
        << e.what();
  }
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
