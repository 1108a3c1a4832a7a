#include "proto/framing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::wire {
namespace {

using Result = MessageDecoder::Result;
using testing::ElementsAre;
using namespace std::string_literals;
using namespace std::string_view_literals;

/// Every message that `stream` holds when it arrives in pieces of `piece` bytes.
std::vector<std::string> decode(std::string_view stream, std::size_t piece) {
  std::vector<std::string> messages;
  MessageDecoder decoder;
  for (; !stream.empty(); stream.remove_prefix(std::min(piece, stream.size()))) {
    std::string_view input = stream.substr(0, piece);
    while (decoder.feed(input) == Result::message) messages.push_back(decoder.message());
    EXPECT_TRUE(input.empty());
  }
  return messages;
}

TEST(Length, IsBigEndian) {
  EXPECT_THAT(encode_length(0), ElementsAre(0x00, 0x00, 0x00, 0x00));
  EXPECT_THAT(encode_length(1), ElementsAre(0x00, 0x00, 0x00, 0x01));
  EXPECT_THAT(encode_length(0x123456), ElementsAre(0x00, 0x12, 0x34, 0x56));
}

TEST(Length, StopsAtTheCap) {
  EXPECT_THAT(encode_length(16777216), ElementsAre(0x01, 0x00, 0x00, 0x00));
  EXPECT_THROW((void)encode_length(16777217), std::length_error);
}

TEST(MessageDecoder, TakesWholeMessages) {
  EXPECT_THAT(decode("\0\0\0\3abc\0\0\0\1d"s, 1000), ElementsAre("abc", "d"));
}

TEST(MessageDecoder, TakesMessagesByteByByte) {
  EXPECT_THAT(decode("\0\0\0\3abc\0\0\0\1d"s, 1), ElementsAre("abc", "d"));
}

TEST(MessageDecoder, TakesPiecesThatCutLengthsAndBodies) {
  for (const std::size_t piece : {2U, 3U, 5U, 6U, 7U, 8U, 9U}) {
    EXPECT_THAT(decode("\0\0\0\3abc\0\0\0\0\0\0\0\2de"s, piece), ElementsAre("abc", "", "de"))
        << piece;
  }
}

TEST(MessageDecoder, TakesAnEmptyMessage) {
  MessageDecoder decoder;
  const std::string stream = "\0\0\0\0\0\0\0\0"s;
  std::string_view input = stream;
  EXPECT_EQ(decoder.feed(input), Result::message);
  EXPECT_EQ(decoder.message(), "");
  EXPECT_EQ(decoder.feed(input), Result::message);
  EXPECT_EQ(decoder.feed(input), Result::need_more);
}

TEST(MessageDecoder, WaitsForTheLastByte) {
  MessageDecoder decoder;
  const std::string stream = "\0\0\0\2ab"s;
  std::string_view input = std::string_view(stream).substr(0, 5);
  EXPECT_EQ(decoder.feed(input), Result::need_more);
  input = std::string_view(stream).substr(5);
  EXPECT_EQ(decoder.feed(input), Result::message);
  EXPECT_EQ(decoder.message(), "ab");
}

TEST(MessageDecoder, TakesTheCapAndRefusesOneMore) {
  MessageDecoder at_cap(5);
  std::string stream = "\0\0\0\5abcde"s;
  std::string_view input = stream;
  EXPECT_EQ(at_cap.feed(input), Result::message);
  EXPECT_EQ(at_cap.message(), "abcde");

  MessageDecoder above(5);
  stream = "\0\0\0\6abcdef"s;
  input = stream;
  EXPECT_EQ(above.feed(input), Result::too_large);
  EXPECT_EQ(above.announced(), 6U);
  EXPECT_EQ(above.feed(input), Result::too_large);
}

TEST(MessageDecoder, GivesTheMemoryOfALargeMessageBack) {
  MessageDecoder decoder;
  const std::string stream = "\0\x10\0\0"s + std::string(1U << 20U, 'x') + "\0\0\0\1y"s;
  std::string_view input = stream;
  ASSERT_EQ(decoder.feed(input), Result::message);
  EXPECT_GE(decoder.held(), 1U << 20U);
  decoder.release();
  EXPECT_LE(decoder.held(), 4096U);
  ASSERT_EQ(decoder.feed(input), Result::message);
  EXPECT_EQ(decoder.message(), "y");
}

TEST(MessageDecoder, TakesNoMoreMemoryThanTheMessageHasBytes) {
  MessageDecoder decoder;
  std::string_view head = "\1\0\0\0"sv;
  ASSERT_EQ(decoder.feed(head), Result::need_more);
  const std::string piece(700'001, 'x');
  for (std::size_t fed = 0; fed + piece.size() < 1U << 24U; fed += piece.size()) {
    std::string_view input = piece;
    ASSERT_EQ(decoder.feed(input), Result::need_more);
    ASSERT_LE(decoder.held(), 1U << 24U);
  }
}

TEST(MessageDecoder, TakesAnotherCapForTheNextMessage) {
  MessageDecoder decoder(2);
  const std::string stream = "\0\0\0\2ab\0\0\0\3cde"s;
  std::string_view input = stream;
  ASSERT_EQ(decoder.feed(input), Result::message);
  decoder.set_cap(3);
  ASSERT_EQ(decoder.feed(input), Result::message);
  EXPECT_EQ(decoder.message(), "cde");
}

TEST(MessageDecoder, RefusesAboveSixteenMebibytesByDefault) {
  MessageDecoder at_cap;
  std::string stream = "\x01\0\0\0"s;
  std::string_view input = stream;
  EXPECT_EQ(at_cap.feed(input), Result::need_more);

  MessageDecoder above;
  stream = "\x01\0\0\x01"s;
  input = stream;
  EXPECT_EQ(above.feed(input), Result::too_large);
  MessageDecoder greatest;
  stream = "\xff\xff\xff\xff"s;
  input = stream;
  EXPECT_EQ(greatest.feed(input), Result::too_large);
  EXPECT_EQ(greatest.announced(), 4294967295U);
}

TEST(MessageDecoder, AllocatesOnlyWithWhatArrives) {
  MessageDecoder decoder;
  const std::string stream = "\x01\0\0\0"s + std::string(1000, 'x');
  std::string_view input = stream;
  EXPECT_EQ(decoder.feed(input), Result::need_more);
  EXPECT_EQ(decoder.message().size(), 1000U);
  EXPECT_LE(decoder.message().capacity(), 2000U);
}

}  // namespace
}  // namespace dtact::wire
