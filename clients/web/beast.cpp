// Boost.Beast's own code, once instead of in every file that includes it.
#include <boost/beast/src.hpp>
