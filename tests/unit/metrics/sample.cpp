// Prints the text of an overview in which everything has a value.
#include "tests/unit/metrics/sample.hpp"

#include <iostream>

int main() { std::cout << dtact::metrics::test::sample(); }
