#if defined(__x86_64__)
#include "compiler/visibility/kernels.inl"

namespace kiln::vis {

const Kernels& avx2_kernels() { return kKernels; }

} // namespace kiln::vis
#endif
