#include "hal/base/utf8.hpp"

#include <gtest/gtest.h>

namespace dtact::base {
namespace {

// The limits of Unicode 15, table 3-7: the last bytes inside and the first outside.
TEST(Utf8, IsWhatProtobufTakes) {
  for (const char* text :
       {"", "lid", "Schl\u00fcssel", "\xC2\x80", "\xDF\xBF", "\xE0\xA0\x80", "\xED\x9F\xBF",
        "\xEF\xBF\xBF", "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(is_utf8(text)) << text;
    EXPECT_EQ(as_utf8(text), text);
  }
  for (const char* text :
       {"\xFC", "\x80", "\xC1\xBF", "\xC2", "\xC2\x61", "\xE0\x9F\xBF", "\xE2\x82", "\xED\xA0\x80",
        "\xF0\x8F\xBF\xBF", "\xF4\x90\x80\x80", "\xF5\x80\x80\x80"}) {
    EXPECT_FALSE(is_utf8(text)) << text;
    EXPECT_FALSE(is_utf8("a" + std::string(text)));
  }
  EXPECT_EQ(as_utf8("Schl\xFC"
                    "ssel"),
            "Schl?ssel");
}

}  // namespace
}  // namespace dtact::base
