// Tokens of VMF text, and of all else that is written in Valve's keys and values. Private to the readers.
#pragma once
#include <cstring>
#include <string_view>

namespace kiln::vmf {

enum class TokenKind { word, open, close, end };
struct Token {
    TokenKind kind = TokenKind::end;
    std::string_view text;
    int line = 1;
    bool unterminated = false; // a string that its line's end cut off
};

class Scanner {
public:
    explicit Scanner(std::string_view text) : text_(text) {}

    Token next() {
        skip_blanks();
        Token token{TokenKind::end, {}, line_, false};
        if (at_ == text_.size()) return token;
        const char c = text_[at_];
        if (c == '{' || c == '}') {
            token.kind = c == '{' ? TokenKind::open : TokenKind::close;
            token.text = text_.substr(at_++, 1);
        } else if (c == '"') {
            // Strings hold no escapes. A line break ends one that was not closed: the rest of the file can then
            // still be read, and the fault is told where it is.
            ++at_;
            std::size_t end = find('"', text_.size());
            const std::size_t line_end = find('\n', end);
            token.unterminated = end == text_.size() || line_end < end;
            if (line_end < end) end = line_end;
            token.kind = TokenKind::word;
            token.text = text_.substr(at_, end - at_);
            at_ = token.unterminated ? end : end + 1;
        } else {
            const std::size_t first = at_;
            while (at_ < text_.size() && !ends_word(text_[at_])) ++at_;
            token.kind = TokenKind::word;
            token.text = text_.substr(first, at_ - first);
        }
        return token;
    }

private:
    std::string_view text_;
    std::size_t at_ = 0;
    int line_ = 1;

    static bool ends_word(char c) {
        return c == ' ' || (c >= '\t' && c <= '\r') || c == '{' || c == '}' || c == '"';
    }
    // The first `c` from here on, or `end`.
    std::size_t find(char c, std::size_t end) const {
        const void* const found = end > at_ ? std::memchr(text_.data() + at_, c, end - at_) : nullptr;
        return found ? static_cast<std::size_t>(static_cast<const char*>(found) - text_.data()) : end;
    }

    void skip_blanks() {
        for (; at_ < text_.size(); ++at_) {
            const char c = text_[at_];
            if (c == '\n') {
                ++line_;
            } else if (c == '/' && at_ + 1 < text_.size() && text_[at_ + 1] == '/') {
                at_ = find('\n', text_.size());
                --at_; // the loop steps on to the line break
            } else if (!(c == ' ' || (c >= '\t' && c <= '\r'))) {
                return;
            }
        }
    }
};

} // namespace kiln::vmf
