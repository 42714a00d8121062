// Characters of .map text. Private to the reader.
#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace kiln::quake {

// Kinds of characters that end a word; masks of them tell which do where.
enum CharKind : std::uint8_t { kBlank = 1, kRound = 2, kSquare = 4, kBrace = 8, kQuote = 16 };
constexpr std::uint8_t kAnyBracket = kBlank | kRound | kSquare | kBrace; // inside a row: ")(" and "]1" need no white space

constexpr std::array<std::uint8_t, 256> kCharKinds = [] {
    std::array<std::uint8_t, 256> kinds{};
    for (const char c : {' ', '\t', '\n', '\v', '\f', '\r'}) kinds[static_cast<std::uint8_t>(c)] = kBlank;
    for (const char c : {'(', ')'}) kinds[static_cast<std::uint8_t>(c)] = kRound;
    for (const char c : {'[', ']'}) kinds[static_cast<std::uint8_t>(c)] = kSquare;
    for (const char c : {'{', '}'}) kinds[static_cast<std::uint8_t>(c)] = kBrace;
    kinds[static_cast<std::uint8_t>('"')] = kQuote;
    return kinds;
}();
constexpr bool is_any(char c, std::uint8_t kinds) {
    return (kCharKinds[static_cast<std::uint8_t>(c)] & kinds) != 0;
}

class Scanner {
public:
    explicit Scanner(std::string_view text) : text_(text) {}
    int line() const { return line_; }
    bool at_end() const { return at_ == text_.size(); }

    // The next character that is neither white space nor comment (0: end), not consumed.
    char peek() {
        skip_blanks(true);
        return at_end() ? '\0' : text_[at_];
    }
    // The same on the present line only: '\n' where nothing more stands on it.
    char peek_on_line() {
        skip_blanks(false);
        return at_end() ? '\n' : text_[at_];
    }
    void take() { ++at_; }
    std::size_t position() const { return at_; }
    // The comment skipped last, if it began at `first` or behind; with its marks.
    std::string_view comment_since(std::size_t first) const {
        return comment_end_ > comment_ && comment_ >= first ? text_.substr(comment_, comment_end_ - comment_) : std::string_view();
    }

    // Text up to one of the kinds of characters.
    std::string_view word(std::uint8_t stops) {
        const std::size_t first = at_;
        while (!at_end() && !is_any(text_[at_], stops)) ++at_;
        return text_.substr(first, at_ - first);
    }
    // A string after its opening quote; false: its line ends before it does. A backslash guards a quote only if
    // another quote follows on the line, for "C:\dir\" ends there while "say \"hi\"" does not.
    bool string(std::string_view& out) {
        std::size_t end = at_;
        while (end < text_.size() && text_[end] != '"' && text_[end] != '\n') ++end;
        if (end < text_.size() && end > at_ && text_[end] == '"' && text_[end - 1] == '\\') end = past_guarded_quotes(end);
        const bool closed = end < text_.size() && text_[end] == '"';
        out = text_.substr(at_, end - at_);
        at_ = closed ? end + 1 : end;
        return closed;
    }
    void skip_line() { at_ = find('\n', at_); }

private:
    std::string_view text_;
    std::size_t at_ = 0, comment_ = 0, comment_end_ = 0;
    int line_ = 1;

    std::size_t find(char c, std::size_t from) const { // text_.size(): none
        const void* const found = from < text_.size() ? std::memchr(text_.data() + from, c, text_.size() - from) : nullptr;
        return found ? static_cast<std::size_t>(static_cast<const char*>(found) - text_.data()) : text_.size();
    }
    std::size_t past_guarded_quotes(std::size_t quote) const {
        const std::size_t line_end = find('\n', quote);
        while (text_[quote - 1] == '\\') {
            const std::size_t next = find('"', quote + 1);
            if (next >= line_end) break;
            quote = next;
        }
        return quote;
    }
    void skip_blanks(bool over_lines) {
        for (; !at_end(); ++at_) {
            const char c = text_[at_];
            if (c == '\n') {
                if (!over_lines) return;
                ++line_;
            } else if (c == ';' || (c == '/' && at_ + 1 < text_.size() && text_[at_ + 1] == '/')) {
                comment_ = at_;
                skip_line(); // ';' begins the comments of QuArK
                comment_end_ = at_--;
            } else if (!is_any(c, kBlank)) {
                return;
            }
        }
    }
};

} // namespace kiln::quake
