#include "tests/fakes/jpeg_maker.hpp"

#include <cstddef>
#include <cstdio>
#include <cstdlib>

// clang-format off: jpeglib.h uses FILE and size_t without declaring them.
#include <jpeglib.h>
// clang-format on

namespace dtact::fakes {
namespace {

/// The same stream without its Huffman table segments (marker FFC4).
std::vector<std::uint8_t> without_huffman_tables(const std::vector<std::uint8_t>& jpeg) {
  std::vector<std::uint8_t> out(jpeg.begin(), jpeg.begin() + 2);
  std::size_t at = 2;
  while (jpeg[at + 1] != 0xDA) {  // start of scan: coded data from here on
    const std::size_t length = 2 + (std::size_t{jpeg[at + 2]} << 8U) + jpeg[at + 3];
    const auto begin = jpeg.begin() + static_cast<std::ptrdiff_t>(at);
    if (jpeg[at + 1] != 0xC4) {
      out.insert(out.end(), begin, begin + static_cast<std::ptrdiff_t>(length));
    }
    at += length;
  }
  out.insert(out.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at), jpeg.end());
  return out;
}

}  // namespace

std::vector<std::uint8_t> make_jpeg(const JpegRecipe& recipe,
                                    const std::function<int(int, int)>& luma) {
  jpeg_compress_struct cinfo{};
  jpeg_error_mgr errors{};
  cinfo.err = jpeg_std_error(&errors);
  jpeg_create_compress(&cinfo);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&cinfo, &memory, &size);
  cinfo.image_width = static_cast<JDIMENSION>(recipe.width);
  cinfo.image_height = static_cast<JDIMENSION>(recipe.height);
  cinfo.input_components = recipe.colour ? 3 : 1;
  cinfo.in_color_space = recipe.colour ? JCS_YCbCr : JCS_GRAYSCALE;
  jpeg_set_defaults(&cinfo);
  jpeg_set_quality(&cinfo, recipe.quality, TRUE);
  cinfo.restart_in_rows = recipe.restart_rows;
  if (recipe.progressive) jpeg_simple_progression(&cinfo);
  jpeg_start_compress(&cinfo, TRUE);
  std::vector<JSAMPLE> row;
  for (int y = 0; y < recipe.height; ++y) {
    row.clear();
    for (int x = 0; x < recipe.width; ++x) {
      row.push_back(static_cast<JSAMPLE>(luma(x, y)));
      if (recipe.colour) {
        row.push_back(static_cast<JSAMPLE>(x * 5));
        row.push_back(static_cast<JSAMPLE>(y * 7));
      }
    }
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&cinfo, &pointer, 1);
  }
  jpeg_finish_compress(&cinfo);
  jpeg_destroy_compress(&cinfo);
  const std::vector<std::uint8_t> jpeg(memory, memory + size);
  std::free(memory);
  return recipe.huffman_tables ? jpeg : without_huffman_tables(jpeg);
}

}  // namespace dtact::fakes
