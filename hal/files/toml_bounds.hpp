#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace dtact::tomlfile {

// Limits of any TOML that is read. The largest calibration that dtact-calibrate writes has three
// LUTs of up to 32,641 numbers, 0.8 MB, and two numbers for each run of pixels outside the lens's
// view, four runs a row at most; usual ones have 0.2 MB. The parser makes about 100 bytes of each
// value and 250 of each key and calls itself for each level.
inline constexpr std::size_t kMaxBytes = std::size_t{4} << 20U;
inline constexpr std::size_t kMaxValues = 262'144;  ///< Of arrays, or arrays and tables in a value.
inline constexpr std::size_t kMaxKeys = 32'768;     ///< Each part of a dotted one, each header.
inline constexpr std::size_t kMaxDepth = 16;        ///< Parts of a key; arrays and inline tables.
inline constexpr std::size_t kMaxWord = 4096;       ///< Bytes of a string, bare key or number.

/// What a text holds. A parser makes no more nodes than both together.
struct Counts {
  std::size_t keys = 0;
  std::size_t values = 0;
};

/// Walks through the text without memory of its own and throws std::runtime_error "WHERE:LINE: what
/// is wrong" before a parser sees text beyond a limit or with control characters. Other text that
/// is no TOML may pass: the parser refuses it where it ends to be TOML.
Counts check_bounds(std::string_view text, const std::string& where);

}  // namespace dtact::tomlfile
