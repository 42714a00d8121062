// Invariants, stated once for two readers: validate() of a stage ends the program at the first that does not hold (a
// fault of the program), `kiln verify` goes on, counts, and names the place of each.
//
//     Check& sides = checker.add("world-sides");
//     sides.expect(s.lightmap_scale > 0, [&] { return Finding{where, "the luxel size is not positive"}; });
#pragma once
#include "libs/core/diagnostic.h"
#include <cstddef>
#include <deque>
#include <string>
#include <utility>
#include <vector>

namespace kiln {

struct Finding {
    SourceLocation where;
    std::string message;
};

class Check {
public:
    std::string code; // stable, kebab-case; `kiln explain` tells what it is about
    std::uint64_t checked = 0, failed = 0;
    std::vector<Finding> findings; // the first few

    Check(std::string c, bool collect, std::size_t most) : code(std::move(c)), collect_(collect), most_(most) {}
    // `tell` () -> Finding is called where it does not hold. Gives `holds`: what relies on it is to be skipped then.
    template <class Tell> bool expect(bool holds, Tell&& tell) {
        ++checked;
        if (!holds) fail(tell());
        return holds;
    }
    bool ok() const { return failed == 0; }

private:
    bool collect_;
    std::size_t most_;
    void fail(Finding finding);
};

class Checker {
public:
    Checker() = default; // the first failure throws InternalError
    // Collects; keeps the first `most` findings of each check, counts all.
    static Checker collecting(std::size_t most);

    Check& add(std::string code) { return checks_.emplace_back(std::move(code), collect_, most_); } // stays where it is
    const std::deque<Check>& checks() const { return checks_; }
    std::uint64_t failures() const;

private:
    bool collect_ = false;
    std::size_t most_ = 0;
    std::deque<Check> checks_;
};

} // namespace kiln
