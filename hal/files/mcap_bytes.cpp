#include "hal/files/mcap_bytes.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <utility>

namespace dtact::mcap {
namespace {

/// A map takes ten times the memory of its smallest entries' bytes.
constexpr std::size_t kMaxEntries = 65'536;

}  // namespace

void put_string(std::string& out, std::string_view text) {
  put(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

void put_map(std::string& out, const std::map<std::string, std::string>& map) {
  std::string entries;
  for (const auto& [key, value] : map) {
    put_string(entries, key);
    put_string(entries, value);
  }
  put_string(out, entries);
}

void put_record(std::string& out, Op op, std::string_view fields) {
  out += static_cast<char>(op);
  put(out, std::uint64_t{fields.size()});
  out += fields;
}

std::uint32_t crc32(std::string_view bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(
      ::crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string_view Cursor::bytes(std::uint64_t length) {
  if (length > left()) {
    fail(fmt::format("{} bytes are announced, {} are left", length, left()));
  }
  const std::string_view taken = bytes_.substr(at_, static_cast<std::size_t>(length));
  at_ += taken.size();
  return taken;
}

std::map<std::string, std::string> Cursor::map() {
  const std::uint64_t begin = offset() + sizeof(std::uint32_t);
  Cursor entries(bytes(take<std::uint32_t>()), name_, begin);
  std::map<std::string, std::string> map;
  while (entries.left() > 0) {
    if (map.size() == kMaxEntries) {
      entries.fail(fmt::format("a map has more than {} entries", kMaxEntries));
    }
    std::string key = entries.string();
    map[std::move(key)] = entries.string();
  }
  return map;
}

Cursor::Record Cursor::record() {
  const std::uint64_t begin = offset();
  const auto op = static_cast<Op>(take<std::uint8_t>());
  const auto length = take<std::uint64_t>();
  return {op, bytes(length), begin};
}

void Cursor::fail(std::string_view what) const {
  throw Error(fmt::format("{}: byte {}: {}", name_, offset(), what));
}

}  // namespace dtact::mcap
