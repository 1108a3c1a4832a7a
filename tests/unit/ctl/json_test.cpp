#include "clients/ctl/json/json.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace dtact::ctl {
namespace {

TEST(Json, WritesNestedObjects) {
  Json json;
  json.open('{').member("a", 1).key("b").open('[').value(true).value("x").close(']');
  json.key("c").open('{').close('}').key("d").null().member("e", std::uint64_t{1} << 63U);
  json.close('}');
  EXPECT_EQ(json.text(), R"({"a":1,"b":[true,"x"],"c":{},"d":null,"e":9223372036854775808})");
}

TEST(Json, WritesListsOfObjects) {
  Json json;
  json.open('[').open('{').close('}').open('{').member("x", -1).close('}').close(']');
  EXPECT_EQ(json.text(), R"([{},{"x":-1}])");
}

TEST(Json, EscapesText) {
  Json json;
  json.value(std::string_view("a\"b\\c\n\x01 µ"));
  EXPECT_EQ(json.text(), "\"a\\\"b\\\\c\\u000a\\u0001 µ\"");
}

TEST(Json, WritesNumbersShortAndNullForNone) {
  Json json;
  json.open('[').value(0.1).value(60.0).value(std::nan("")).value(INFINITY).close(']');
  EXPECT_EQ(json.text(), "[0.1,60,null,null]");
}

TEST(Json, WritesListsOfTexts) {
  EXPECT_EQ(Json().value(std::vector<std::string>{}).text(), "[]");
  EXPECT_EQ(Json().value(std::vector<std::string>{"a", "b"}).text(), R"(["a","b"])");
}

}  // namespace
}  // namespace dtact::ctl
