// The one translation unit that holds tinygltf's code, so that it is built with our sanitizers.
#include <fstream>

#define TINYGLTF_IMPLEMENTATION
#include "core/tinygltf_include.h"
