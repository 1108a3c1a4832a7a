/* RVL, the run-length and nibble code of Wilson, "Fast Lossless Depth Image Compression" (2017):
 * the pixels are, in turn, a run of zeros (its length) and a run of others (its length, then the
 * difference of each to the last pixel that was not zero, zigzag). Numbers are sent as nibbles of
 * three bits, least significant first, the fourth bit says that another follows; eight nibbles
 * fill a 32-bit word from its most significant end, and words are little-endian. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <string.h>

struct nibbles {
  const uint8_t *next; /* the next word */
  const uint8_t *end;
  uint32_t word;
  int left; /* nibbles of `word` not taken yet */
};

/* The next number; -1 when the bytes end before it does or it has more than 32 bits. */
static int64_t take(struct nibbles *in) {
  uint64_t value = 0;
  for (int shift = 0; shift < 33; shift += 3) {
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
    value |= (uint64_t)(nibble & 7) << shift;
    if ((nibble & 8) == 0) return value <= UINT32_MAX ? (int64_t)value : -1;
  }
  return -1;
}

/* What is wrong, or null. `out` is zero before. */
static const char *decode(struct nibbles in, int16_t *out, int64_t count) {
  int64_t previous = 0;
  int64_t at = 0;
  while (at < count) {
    const int64_t zeros = take(&in);
    if (zeros < 0) return "the bytes end within a run of zeros";
    if (zeros > count - at) return "a run of zeros ends beyond the map";
    at += zeros;
    const int64_t others = take(&in);
    if (others < 0) return "the bytes end within a run";
    if (others > count - at) return "a run ends beyond the map";
    if (zeros == 0 && others == 0) return "a pair of runs is empty";
    for (int64_t i = 0; i < others; ++i) {
      const int64_t zigzag = take(&in);
      if (zigzag < 0) return "the bytes end within a run";
      previous += (zigzag >> 1) ^ -(zigzag & 1);
      if (previous < INT16_MIN || previous > INT16_MAX) return "a pixel does not fit int16";
      out[at++] = (int16_t)previous;
    }
  }
  return in.next == in.end ? NULL : "bytes follow the last pixel";
}

static PyObject *rvl_decode(PyObject *self, PyObject *arguments) {
  (void)self;
  Py_buffer data;
  Py_ssize_t count;
  if (!PyArg_ParseTuple(arguments, "y*n", &data, &count)) return NULL;
  if (count < 0 || count > PY_SSIZE_T_MAX / 2) {
    PyBuffer_Release(&data);
    PyErr_SetString(PyExc_ValueError, "a negative or too large number of pixels");
    return NULL;
  }
  PyObject *pixels = PyByteArray_FromStringAndSize(NULL, 2 * count);
  if (pixels == NULL) {
    PyBuffer_Release(&data);
    return NULL;
  }
  int16_t *out = (int16_t *)PyByteArray_AsString(pixels);
  const char *wrong;
  Py_BEGIN_ALLOW_THREADS;
  memset(out, 0, 2 * (size_t)count);
  const struct nibbles in = {data.buf, (const uint8_t *)data.buf + data.len, 0, 0};
  wrong = decode(in, out, count);
  Py_END_ALLOW_THREADS;
  PyBuffer_Release(&data);
  if (wrong != NULL) {
    Py_DECREF(pixels);
    PyErr_SetString(PyExc_ValueError, wrong);
    return NULL;
  }
  return pixels;
}

static PyMethodDef methods[] = {
    {"decode", rvl_decode, METH_VARARGS,
     "decode(data, count): the `count` pixels as native int16 in a bytearray; ValueError for bytes\n"
     "that are not RVL of exactly so many."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "dtact._rvl", NULL, 0, methods,
                                    NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__rvl(void) { return PyModule_Create(&module); }
