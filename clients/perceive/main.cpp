#include <iostream>

#include "clients/perceive/perceive.hpp"

int main(int argc, char** argv) {
  return dtact::perceive::run({argv + 1, argv + argc}, std::cout, std::cerr);
}
