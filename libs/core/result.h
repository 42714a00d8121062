// Result<T>: a value, or the fault that made one impossible.
#pragma once
#include "libs/core/diagnostic.h"
#include <optional>
#include <utility>

namespace kiln {

struct Fault {
    Exit exit = Exit::internal;
    Diagnostic diagnostic;
};

inline Fault fault(Exit exit, std::string code, std::string message, SourceLocation where = {}) {
    return {exit, {Severity::error, std::move(code), std::move(where), std::move(message)}};
}

template <class T> class [[nodiscard]] Result {
public:
    Result(T value) : value_(std::move(value)) {}
    Result(Fault fault) : fault_(std::move(fault)) {}
    explicit operator bool() const { return value_.has_value(); }
    T& operator*() & { return *value_; }
    const T& operator*() const& { return *value_; }
    T&& operator*() && { return std::move(*value_); }
    T* operator->() { return &*value_; }
    const T* operator->() const { return &*value_; }
    const Fault& fault() const { return fault_; }

private:
    std::optional<T> value_;
    Fault fault_;
};

} // namespace kiln
