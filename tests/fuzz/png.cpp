// A PNG. What is decoded has the size of its header, and can be written and is the same again.
#include "hal/files/png.hpp"

#include <stdexcept>

#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/png_checksums.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  const std::string png = fuzz::with_right_checksums({reinterpret_cast<const char*>(data), size});
  try {
    const image::PngHeader header = image::png_header(png, "seed");
    // Larger ones say nothing new and take long.
    if (header.width * header.height > 1 << 23) return 0;
    const image::Grey16 image = image::decode_png_grey16(png, "seed");
    fuzz::require(image.width == header.width && image.height == header.height,
                  "the header says the size");
    if (size > 1 << 16) return 0;
    fuzz::require(
        image::decode_png_grey16(image::encode_png(image), "again").pixels == image.pixels,
        "a picture that is written is the same");
  } catch (const std::runtime_error& e) {
    fuzz::require(*e.what() != 0, "an error says something");
  }
  return 0;
}
