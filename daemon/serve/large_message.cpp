#include "daemon/serve/large_message.hpp"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <cstdint>

#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

/// Fields of a message: today's and room for some later ones.
constexpr int kMaxFields = 16;

/// Whether `bytes` are at most kMaxFields fields, numbers or bytes, of which `may_be_bytes` allows
/// those of bytes.
template <typename MayBeBytes>
bool few_fields(std::string_view bytes, const MayBeBytes& may_be_bytes) {
  CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                      static_cast<int>(bytes.size()));
  for (int fields = 0; fields <= kMaxFields; ++fields) {
    const std::uint32_t tag = in.ReadTag();
    if (tag == 0) return in.ConsumedEntireMessage();
    const auto type = WireFormatLite::GetTagWireType(tag);
    if (type == WireFormatLite::WIRETYPE_START_GROUP) return false;
    if (type != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
      if (!WireFormatLite::SkipField(&in, tag)) return false;
      continue;
    }
    std::uint32_t size = 0;
    if (!in.ReadVarint32(&size)) return false;
    const auto begin = static_cast<std::size_t>(in.CurrentPosition());
    if (size > bytes.size() - begin || !in.Skip(static_cast<int>(size))) return false;
    if (!may_be_bytes(WireFormatLite::GetTagFieldNumber(tag), bytes.substr(begin, size))) {
      return false;
    }
  }
  return false;
}

}  // namespace

bool is_plain_upload(std::string_view bytes) {
  return few_fields(bytes, [](int field, std::string_view value) {
    if (field == v1::ClientMessage::kOnBehalfOfFieldNumber)
      return value.size() <= wire::kMaxOnBehalfOf;
    return field == v1::ClientMessage::kUploadCalibrationFieldNumber &&
           few_fields(value, [](int, std::string_view) { return true; });
  });
}

}  // namespace dtact::net
