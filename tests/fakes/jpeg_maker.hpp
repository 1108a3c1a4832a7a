#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace dtact::fakes {

/// How a test picture is coded.
struct JpegRecipe {
  int width = 64;
  int height = 48;
  int quality = 95;
  bool colour = true;  ///< YCbCr 4:2:0 with varied chroma; else grey only.
  bool progressive = false;
  int restart_rows = 0;        ///< Restart marker every `restart_rows` rows of blocks; 0 = none.
  bool huffman_tables = true;  ///< false: left out, like UVC cameras do.
};

/// A JPEG whose luma at column x, row y is luma(x, y) before coding.
[[nodiscard]] std::vector<std::uint8_t> make_jpeg(const JpegRecipe& recipe,
                                                  const std::function<int(int, int)>& luma);

}  // namespace dtact::fakes
