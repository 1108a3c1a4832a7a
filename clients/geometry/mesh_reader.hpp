#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "clients/geometry/mesh_file.hpp"

namespace dtact::perceive {

/// A word of a file for a message, which travels as UTF-8.
[[nodiscard]] std::string shown(std::string_view word);

/// The bytes of a shape's file, taken one after another. Everything throws std::runtime_error
/// naming file and place where they end too early or are not what is asked for.
class MeshReader {
 public:
  MeshReader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  /// "FILE, line 7: SENTENCE" or, of binary data, "FILE, byte 84: SENTENCE".
  [[noreturn]] void fail(const std::string& sentence) const;
  /// From here on places are bytes.
  void begin_binary() noexcept { binary_ = true; }
  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size() - at_; }

  /// The next word of text, over line ends; empty at the end.
  [[nodiscard]] std::string_view word();
  /// The rest of the line, without its end; the next word is of the next line.
  [[nodiscard]] std::string_view line();
  [[nodiscard]] double number();
  void expect(std::string_view word);
  /// Fails unless the file ends here, but for blanks of text. `last`: what was read last.
  void expect_end(const std::string& last);

  /// Binary data.
  void skip(std::size_t count);
  template <typename Value>
  [[nodiscard]] Value binary(bool big_endian) {
    std::array<std::byte, sizeof(Value)> raw{};
    const std::string_view taken = take(sizeof(Value));
    for (std::size_t i = 0; i < raw.size(); ++i) {
      const std::size_t from = big_endian == kNativeBig ? i : raw.size() - 1 - i;
      raw.at(i) = static_cast<std::byte>(taken[from]);
    }
    return std::bit_cast<Value>(raw);
  }

 private:
  static constexpr bool kNativeBig = std::endian::native == std::endian::big;

  [[nodiscard]] std::string_view take(std::size_t count);
  void skip_space();

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
  bool binary_ = false;
};

/// The two formats. Only what does not fit into a Mesh is refused here: parse_mesh() checks the
/// rest.
[[nodiscard]] Mesh parse_stl(std::string_view bytes, const std::string& name);
[[nodiscard]] Mesh parse_ply(std::string_view bytes, const std::string& name);

}  // namespace dtact::perceive
