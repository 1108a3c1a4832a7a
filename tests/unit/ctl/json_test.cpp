// The JSON that every program's --json prints.
#include "clients/common/json.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "clients/common/reports.pb.h"
#include "proto/dtact.pb.h"

namespace dtact::cli {
namespace {

TEST(Json, NumbersOfEveryTypeAreNumbers) {
  RecordingReport report;
  report.set_output("press.mcap");
  report.set_frames(18446744073709551615U);
  EXPECT_EQ(
      json_line(report),
      R"({"output":"press.mcap","frames":18446744073709551615,"maps":0,"damage":"","out_of_order":0})"
      "\n");
  v1::LightState light;
  light.set_since_ns(-9007199254740993);
  light.set_gamma(2.2);
  EXPECT_NE(json_line(light).find(R"("since_ns":-9007199254740993,"gamma":2.2})"),
            std::string::npos)
      << json_line(light);
}

TEST(Json, WhatIsNoNumberIsNull) {
  v1::Reconstruction how;
  how.set_max_error_um(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(json_line(how), "{\"resolution\":\"\",\"sharpen\":\"\",\"max_error_um\":null}\n");
}

TEST(Json, LeavesOutWhatIsUnsetAndNamesEnumerations) {
  v1::Frame frame;
  frame.add_health(v1::HEALTH_UNCALIBRATED);
  frame.add_health(v1::HEALTH_NONE);
  const std::string json = json_line(frame);
  EXPECT_NE(json.find(R"("health":["HEALTH_UNCALIBRATED","HEALTH_NONE"])"), std::string::npos)
      << json;
  EXPECT_EQ(json.find("\"depth\""), std::string::npos) << json;
  EXPECT_NE(json.find(R"("sequence":0)"), std::string::npos) << json;
}

TEST(Json, EscapesWhatAStringMayNotHold) {
  EXPECT_EQ(json_string("a \"b\"\\\n\x1f"), R"("a \"b\"\\\u000a\u001f")");
  EXPECT_EQ(json_string("µm € 𝄞"), "\"µm € 𝄞\"");
}

TEST(Json, ReplacesBytesThatAreNoUtf8) {
  EXPECT_EQ(json_string("a\xff!"), "\"a\xef\xbf\xbd!\"");
  EXPECT_EQ(json_string("\xc3"), "\"\xef\xbf\xbd\"");                  // cut off
  EXPECT_EQ(json_string("\xc0\x80"), "\"\xef\xbf\xbd\xef\xbf\xbd\"");  // 0 in two bytes
  EXPECT_EQ(json_string("\xed\xa0\x80").size(), 2U + 3 * 3);           // a surrogate
  EXPECT_EQ(json_string("\xf4\x90\x80\x80").size(), 2U + 4 * 3);       // beyond U+10FFFF
  EXPECT_EQ(json_string("\xf4\x8f\xbf\xbf"), "\"\xf4\x8f\xbf\xbf\"");  // U+10FFFF
}

TEST(Json, BytesAreBase64) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("png of first"), "cG5nIG9mIGZpcnN0");
  EXPECT_EQ(base64("a"), "YQ==");
}

}  // namespace
}  // namespace dtact::cli
