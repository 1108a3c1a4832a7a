// Boost.Asio's own code, once for both ends instead of once in every file that includes it.
#include <boost/asio/impl/src.hpp>
