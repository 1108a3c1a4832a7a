#include "hal/frame.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace dtact::hal {
namespace {

struct Lender final : FrameOwner {
  void give_back(int index) noexcept override { returned.push_back(index); }
  std::vector<int> returned;
};

TEST(Frame, EmptyLeaseReturnsNothing) {
  const Frame frame;
  EXPECT_FALSE(frame);
  EXPECT_EQ(frame.luma().data, nullptr);
}

TEST(Frame, DestructorGivesTheBufferBackOnce) {
  Lender lender;
  {
    const Frame frame(lender, 3, {}, {});
  }
  EXPECT_EQ(lender.returned, std::vector<int>{3});
}

TEST(Frame, MoveCarriesTheLease) {
  Lender lender;
  {
    Frame a(lender, 1, {}, {});
    const Frame b(std::move(a));
    EXPECT_FALSE(a);  // NOLINT(bugprone-use-after-move): a moved-from lease is empty by contract
    EXPECT_TRUE(lender.returned.empty());
  }
  EXPECT_EQ(lender.returned, std::vector<int>{1});
}

TEST(Frame, AssigningReturnsTheFrameBefore) {
  Lender lender;
  Frame frame(lender, 1, {}, {});
  frame = Frame(lender, 2, {}, {});
  EXPECT_EQ(lender.returned, std::vector<int>{1});
  frame.reset();
  frame.reset();
  EXPECT_EQ(lender.returned, (std::vector<int>{1, 2}));
}

}  // namespace
}  // namespace dtact::hal
