/* RVL, the run-length and nibble code of Wilson, "Fast Lossless Depth Image Compression" (2017):
 * the pixels are, in turn, a run of zeros (its length) and a run of others (its length, then the
 * difference of each to the last pixel that was not zero, zigzag). Numbers are sent as nibbles of
 * three bits, least significant first, the fourth bit says that another follows; eight nibbles
 * fill a 32-bit word from its most significant end, and words are little-endian.
 *
 * Without Python, so that tests/fuzz compares it with the C++ library: this is C and C++. */
#pragma once

#include <stddef.h>
#include <stdint.h>

struct nibbles {
  const uint8_t *next; /* the next word */
  const uint8_t *end;
  uint32_t word;
  int left; /* nibbles of `word` not taken yet */
};

/* The next number; -1 when the words end before it does, or it is longer than any in a map or than
 * it needs to be. */
static int32_t take(struct nibbles *in) {
  uint32_t value = 0;
  for (int shift = 0; shift < 30; shift += 3) {
    if (in->left == 0) {
      if (in->end - in->next < 4) return -1;
      in->word = (uint32_t)in->next[0] | (uint32_t)in->next[1] << 8 |
                 (uint32_t)in->next[2] << 16 | (uint32_t)in->next[3] << 24;
      in->next += 4;
      in->left = 8;
    }
    const uint32_t nibble = in->word >> 28;
    in->word <<= 4;
    --in->left;
    value |= (nibble & 7) << shift;
    if (nibble < 8) return nibble != 0 || shift == 0 ? (int32_t)value : -1;
  }
  return -1;
}

/* What is wrong, or null. `out` is zero before. Exactly what the encoder makes is taken, as by the
 * C++ library. */
static const char *rvl_decode(const uint8_t *data, ptrdiff_t size, int16_t *out, ptrdiff_t count) {
  struct nibbles in = {data, data + size, 0, 0};
  int32_t previous = 0;
  ptrdiff_t at = 0;
  while (at < count) {
    const int32_t zeros = take(&in);
    if (zeros < 0 || zeros > count - at || (zeros == 0 && at != 0)) return "bad run of zeros";
    at += zeros;
    const int32_t others = take(&in);
    if (others < 0 || others > count - at || (others == 0 && at != count)) return "bad run";
    for (const ptrdiff_t end = at + others; at < end; ++at) {
      const int32_t zigzag = take(&in);
      if (zigzag < 0) return "the bytes end within a run";
      previous += (zigzag >> 1) ^ -(zigzag & 1);
      if (previous < INT16_MIN || previous > INT16_MAX || previous == 0) return "bad pixel";
      out[at] = (int16_t)previous;
    }
  }
  return in.next == in.end && in.word == 0 ? NULL : "bytes follow the last pixel";
}
