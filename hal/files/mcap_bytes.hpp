#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>

#include "hal/files/mcap_format.hpp"

namespace dtact::mcap {

/// A file that is no MCAP, or damaged. The sentence names the file and the byte.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Appends an integer, little-endian.
template <std::unsigned_integral T>
void put(std::string& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    out += static_cast<char>(static_cast<unsigned char>(value >> (8 * i)));
  }
}
void put_string(std::string& out, std::string_view text);
void put_map(std::string& out, const std::map<std::string, std::string>& map);
/// A whole record: opcode, length, fields.
void put_record(std::string& out, Op op, std::string_view fields);

/// CRC-32 as zlib has it, of `bytes` after those that gave `before`.
[[nodiscard]] std::uint32_t crc32(std::string_view bytes, std::uint32_t before = 0);

/// Takes fields from the front of foreign bytes. Everything that would reach beyond them throws an
/// Error with the place in the file.
class Cursor {
 public:
  /// `name`: the file's; `offset`: where the bytes lie in it. Both views must outlive the cursor.
  Cursor(std::string_view bytes, std::string_view name, std::uint64_t offset)
      : bytes_(bytes), name_(name), offset_(offset) {}

  template <std::unsigned_integral T>
  [[nodiscard]] T take() {
    const std::string_view raw = bytes(sizeof(T));
    T value = 0;
    for (std::size_t i = sizeof(T); i-- > 0;) {
      value = static_cast<T>(static_cast<std::uint64_t>(value) << 8U |
                             static_cast<unsigned char>(raw[i]));
    }
    return value;
  }
  [[nodiscard]] std::string_view bytes(std::uint64_t length);
  [[nodiscard]] std::string_view rest() { return bytes(left()); }
  /// With a length of 32 bits before it.
  [[nodiscard]] std::string string() { return std::string(bytes(take<std::uint32_t>())); }
  [[nodiscard]] std::map<std::string, std::string> map();
  struct Record {
    Op op;
    std::string_view fields;
    std::uint64_t offset;  ///< position of the opcode
  };
  [[nodiscard]] Record record();

  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size() - at_; }
  [[nodiscard]] std::string_view taken() const noexcept { return bytes_.substr(0, at_); }
  [[nodiscard]] std::uint64_t offset() const noexcept { return offset_ + at_; }
  [[noreturn]] void fail(std::string_view what) const;

 private:
  std::string_view bytes_;
  std::string_view name_;
  std::uint64_t offset_;
  std::size_t at_ = 0;
};

}  // namespace dtact::mcap
