// CHECK: a broken invariant of our own stops the program with what was compared. Faults of the input are
// Diagnostics, never CHECKs.
#pragma once
#include <sstream>
#include <stdexcept>
#include <string>

namespace kiln {

struct InternalError : std::logic_error {
    using std::logic_error::logic_error;
};
[[noreturn]] void check_failed(const char* file, int line, const std::string& what);

} // namespace kiln

#define KILN_CHECK(condition)                                                                                    \
    do {                                                                                                         \
        if (!(condition)) ::kiln::check_failed(__FILE__, __LINE__, #condition);                                  \
    } while (false)
#define KILN_CHECK_OP(a, op, b)                                                                                  \
    do {                                                                                                         \
        const auto& check_a_ = (a);                                                                              \
        const auto& check_b_ = (b);                                                                              \
        if (!(check_a_ op check_b_)) {                                                                           \
            std::ostringstream check_s_;                                                                         \
            check_s_ << #a " " #op " " #b ": " << check_a_ << " against " << check_b_;                           \
            ::kiln::check_failed(__FILE__, __LINE__, check_s_.str());                                            \
        }                                                                                                        \
    } while (false)
