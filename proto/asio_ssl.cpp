// Boost.Asio's own code for TLS, once for both ends, as asio.cpp.
#include <boost/asio/ssl/impl/src.hpp>
