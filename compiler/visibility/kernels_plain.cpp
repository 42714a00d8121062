#include "compiler/visibility/kernels.inl"

namespace kiln::vis {

const Kernels& plain_kernels() { return kKernels; }
const Kernels& kernels() {
#if defined(__x86_64__)
    static const Kernels& best = __builtin_cpu_supports("avx2") ? avx2_kernels() : plain_kernels();
    return best;
#else
    return plain_kernels();
#endif
}

} // namespace kiln::vis
