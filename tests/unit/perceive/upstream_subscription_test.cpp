// What dtact-perceive subscribes to, depending on its own clients.
#include "clients/perceive/upstream_subscription.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <variant>

#include "proto/defaults.hpp"

namespace dtact::perceive {
namespace {

net::Subscription of(const v1::Subscribe& request) {
  return std::get<net::Subscription>(net::Subscription::from(request, {}, net::Serves::geometry));
}

v1::Subscribe points(bool contact, std::uint32_t decimation = 1) {
  v1::Subscribe request;
  request.set_cloud(v1::CLOUD_INT16);
  if (contact) request.set_contact_box(true);
  request.set_decimation(decimation);
  return request;
}

v1::Subscribe pose() {
  v1::Subscribe request;
  request.set_pose(true);
  return request;
}

v1::Subscribe wanted(bool in_contact, std::initializer_list<v1::Subscribe> requests,
                     double mm_per_px = 0.0417) {
  UpstreamSubscription demand(in_contact, mm_per_px);
  for (const v1::Subscribe& request : requests) demand.add(of(request));
  return demand.subscription();
}

TEST(UpstreamSubscription, NobodyWantsAnything) {
  const v1::Subscribe nothing = wanted(true, {v1::Subscribe{}});
  EXPECT_FALSE(nothing.summary());
  EXPECT_EQ(nothing.depth(), v1::DEPTH_NONE);
  EXPECT_FALSE(nothing.events());
}

TEST(UpstreamSubscription, WholeMapsOnlyDuringContact) {
  EXPECT_EQ(wanted(false, {points(false)}).depth(), v1::DEPTH_NONE);
  EXPECT_TRUE(wanted(false, {points(false)}).summary()) << "which says during contact";
  const v1::Subscribe in_contact = wanted(true, {points(false)});
  EXPECT_EQ(in_contact.depth(), v1::DEPTH_INT16);
  EXPECT_FALSE(in_contact.contact_box());
}

TEST(UpstreamSubscription, ContactsAndPosesFromTheirFirstFrameOn) {
  for (const v1::Subscribe& request : {points(true), pose()}) {
    const v1::Subscribe asked = wanted(false, {request});
    EXPECT_EQ(asked.depth(), v1::DEPTH_INT16);
    EXPECT_TRUE(asked.contact_box());
  }
  EXPECT_TRUE(wanted(false, {points(false), pose()}).contact_box());
  EXPECT_FALSE(wanted(true, {points(false), pose()}).contact_box());
}

TEST(UpstreamSubscription, RecognitionHasCoarseWholeMapsDuringContact) {
  v1::Subscribe recognition;
  recognition.set_recognition(true);
  EXPECT_EQ(wanted(false, {recognition}).depth(), v1::DEPTH_NONE);
  EXPECT_EQ(wanted(true, {recognition}).depth(), v1::DEPTH_INT16);
  EXPECT_EQ(wanted(true, {recognition}).decimation(), 4U);
  EXPECT_FALSE(wanted(true, {recognition, pose()}).contact_box());
  EXPECT_EQ(wanted(true, {recognition, pose()}).decimation(), 0U);
  // The network's cells are 0.25 mm wide.
  EXPECT_EQ(wanted(true, {recognition}, 0).decimation(), 4U) << "nothing known yet";
  EXPECT_EQ(wanted(true, {recognition}, 0.1).decimation(), 2U);
  EXPECT_EQ(wanted(true, {recognition, points(false, 4)}, 0.2).decimation(), 0U);
}

TEST(UpstreamSubscription, AsCoarseAsTheFinestClient) {
  EXPECT_EQ(wanted(true, {points(false, 4)}).decimation(), 4U);
  EXPECT_EQ(wanted(true, {points(false, 4), points(true, 2)}).decimation(), 2U);
  EXPECT_EQ(wanted(true, {points(false, 4), pose()}).decimation(), 0U);
}

}  // namespace
}  // namespace dtact::perceive
