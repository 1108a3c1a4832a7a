#include "hal/libcamera/dma_buffer.hpp"

#include <gtest/gtest.h>
#include <libcamera/formats.h>
#include <linux/dma-buf.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "tests/unit/libcamera/kernel_double.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;
using libcamera_test::KernelDouble;
using libcamera_test::new_kernel;
using testing::Test;

/// A heap's node: it opens, and the double answers for it.
constexpr std::array kNodes{"/dev/dma_heap/none such", "/dev/null"};

lc::StreamConfiguration nv12() {
  lc::StreamConfiguration stream;
  stream.pixelFormat = lc::formats::NV12;
  stream.size = {800, 600};
  stream.stride = 832;
  stream.frameSize = 832 * 900;
  stream.bufferCount = 4;
  return stream;
}

TEST(DmaHeap, TakesTheFirstNodeThatOpens) {
  const KernelDouble& kernel = new_kernel();
  const DmaHeap heap(kNodes);
  const base::UniqueFd buffer = heap.allocate(5000);
  ASSERT_TRUE(buffer);
  EXPECT_EQ(::lseek(buffer.get(), 0, SEEK_END), 5000);
  EXPECT_EQ(kernel.allocated, 1U);
}

TEST(DmaHeap, GivesNothingWithoutANodeOrWithoutMemory) {
  KernelDouble& kernel = new_kernel();
  EXPECT_FALSE(DmaHeap(std::span(kNodes).first(1)).allocate(5000));
  EXPECT_EQ(kernel.allocated, 0U);
  kernel.has_memory = false;
  EXPECT_FALSE(DmaHeap(kNodes).allocate(5000));
  EXPECT_TRUE(make_frame_buffers(DmaHeap(kNodes), nv12()).empty());
}

TEST(DmaHeap, MakesTheBuffersOfAStream) {
  const KernelDouble& kernel = new_kernel();
  const auto buffers = make_frame_buffers(DmaHeap(kNodes), nv12());
  ASSERT_EQ(buffers.size(), 4U);
  EXPECT_EQ(kernel.allocated, 4U);
  ASSERT_EQ(buffers[0]->planes().size(), 2U);
  EXPECT_EQ(buffers[0]->planes()[1].offset, 832U * 600);
  EXPECT_EQ(buffers[0]->planes()[0].fd.get(), buffers[0]->planes()[1].fd.get());
  EXPECT_NE(buffers[0]->planes()[0].fd.get(), buffers[1]->planes()[0].fd.get());
}

TEST(DmaBuffer, LaysPlanesOneAfterTheOther) {
  EXPECT_EQ(planes_of(lc::formats::R8, 1280, 800, 1024000),
            (std::vector<PlaneExtent>{{0, 1024000}}));
  EXPECT_EQ(planes_of(lc::formats::NV12, 832, 600, 748800),
            (std::vector<PlaneExtent>{{0, 499200}, {499200, 249600}}));
  EXPECT_EQ(planes_of(lc::formats::YUV420, 832, 600, 749568),  // 768 more than it needs
            (std::vector<PlaneExtent>{{0, 499200}, {499200, 124800}, {624000, 125568}}));
}

TEST(DmaBuffer, BracketsReading) {
  const KernelDouble& kernel = new_kernel();
  EXPECT_TRUE(sync_for_reading(0, true));
  EXPECT_TRUE(sync_for_reading(0, false));
  EXPECT_EQ(kernel.syncs, (std::vector<unsigned>{DMA_BUF_SYNC_READ | DMA_BUF_SYNC_START,
                                                 DMA_BUF_SYNC_READ | DMA_BUF_SYNC_END}));
}

TEST(DmaBuffer, AsksAgainWhenInterrupted) {
  KernelDouble& kernel = new_kernel();
  kernel.failures = {EINTR, EAGAIN};
  EXPECT_TRUE(sync_for_reading(0, true));
  EXPECT_EQ(kernel.syncs.size(), 3U);
}

TEST(DmaBuffer, SaysWhenTheCachesMayBeStale) {
  KernelDouble& kernel = new_kernel();
  kernel.failures = {EIO, ENOTTY};
  EXPECT_FALSE(sync_for_reading(0, true));
  EXPECT_TRUE(sync_for_reading(0, true));  // no DMA buffer
}

TEST(DmaBuffer, MapsWhatIsThere) {
  new_kernel();
  const base::UniqueFd buffer = DmaHeap(kNodes).allocate(5000);
  ASSERT_EQ(::pwrite(buffer.get(), "x", 1, 4999), 1);
  Mapping mapping(buffer.get(), 5000);
  Mapping moved(std::move(mapping));
  EXPECT_EQ(moved.bytes()[4999], 'x');
  EXPECT_TRUE(mapping.bytes().empty());  // NOLINT(bugprone-use-after-move): documented
  EXPECT_THROW(Mapping(-1, 5000), std::system_error);
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
