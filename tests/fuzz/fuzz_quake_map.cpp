#include "tests/fuzz/map_bytes.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    kiln::fuzz::run(kiln::read_quake_map, {data, size});
    return 0;
}
