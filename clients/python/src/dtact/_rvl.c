/* The module dtact._rvl: _rvl_decode.h for Python. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

#include "_rvl_decode.h"

static PyObject *decode(PyObject *self, PyObject *arguments) {
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
  wrong = rvl_decode(data.buf, data.len, out, count);
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
    {"decode", decode, METH_VARARGS,
     "decode(data, count): the `count` pixels as native int16 in a bytearray; ValueError for bytes\n"
     "that are not RVL of exactly so many."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "dtact._rvl", NULL, 0, methods,
                                    NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__rvl(void) { return PyModule_Create(&module); }
