#include <gtest/gtest.h>

#include "daemon/net/depth_maps.hpp"

namespace dtact::net {
namespace {

pipeline::DepthFrame in_contact() {
  pipeline::DepthFrame frame;
  frame.has_depth = true;
  frame.width = 100;
  frame.height = 80;
  frame.depth_um.assign(8000, 0);
  frame.contact.in_contact = true;
  frame.contact_um = 100;
  return frame;
}

void press(pipeline::DepthFrame& frame, int x, int y, std::int16_t um = 101) {
  frame.depth_um[static_cast<std::size_t>(y * frame.width + x)] = um;
}

TEST(ContactBox, LiesSixteenPixelsAroundWhatIsPressed) {
  auto frame = in_contact();
  press(frame, 40, 35);
  press(frame, 50, 30);
  press(frame, 90, 70, 100);  // not deeper than the threshold
  EXPECT_EQ(contact_box(frame), (DepthRegion{24, 14, 43, 38}));
}

TEST(ContactBox, IsCutAtTheOrigin) {
  auto frame = in_contact();
  press(frame, 3, 2);
  EXPECT_EQ(contact_box(frame), (DepthRegion{0, 0, 20, 19}));
}

TEST(ContactBox, IsInPixelsOfTheFullResolution) {
  auto frame = in_contact();
  frame.decimation = 2;
  press(frame, 10, 20);
  EXPECT_EQ(contact_box(frame), (DepthRegion{4, 24, 34, 34}));
}

TEST(ContactBox, IsNowhereWithoutContact) {
  auto frame = in_contact();
  EXPECT_EQ(contact_box(frame), std::nullopt) << "not deep enough any more, and not lost yet";
  press(frame, 10, 20);
  frame.contact.in_contact = false;
  EXPECT_EQ(contact_box(frame), std::nullopt);
  frame.contact.in_contact = true;
  frame.has_depth = false;
  EXPECT_EQ(contact_box(frame), std::nullopt);
}

}  // namespace
}  // namespace dtact::net
