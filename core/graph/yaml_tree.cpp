#include "core/graph/yaml_tree.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <numeric>
#include <sstream>

#include "core/base/text.h"

namespace voxloom {

int YamlNode::index_of(std::string_view key) const {
    for (std::size_t i = 0; i < keys.size(); ++i)
        if (keys[i].text == key) return int(i);
    return -1;
}

const YamlNode* YamlNode::find(std::string_view key) const {
    int i = index_of(key);
    return i < 0 ? nullptr : &items[std::size_t(i)];
}

std::size_t skip_blank(std::string_view text, std::size_t position) {
    while (position < text.size()) {
        if (text[position] == '#')
            position = std::min(text.find('\n', position), text.size());
        else if (std::string_view(" \t\r\n").find(text[position]) != std::string_view::npos)
            ++position;
        else
            break;
    }
    return position;
}

// The first tab before the text of the line that holds `position`; the text's size when there is none.
static std::size_t tab_in_indentation(std::string_view text, std::size_t position) {
    const std::size_t before = position == 0 ? std::string_view::npos : text.rfind('\n', position - 1);
    for (std::size_t i = before == std::string_view::npos ? 0 : before + 1; i < text.size(); ++i) {
        if (text[i] == '\t') return i;
        if (text[i] != ' ') break;
    }
    return text.size();
}

std::size_t find_invalid_utf8(std::string_view text) {
    auto byte = [&](std::size_t i) {
        return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
    };
    for (std::size_t i = 0; i < text.size();) {
        unsigned lead = byte(i);
        std::size_t length = lead < 0x80                   ? 1
                             : lead >= 0xc2 && lead < 0xe0 ? 2
                             : lead >= 0xe0 && lead < 0xf0 ? 3
                             : lead >= 0xf0 && lead < 0xf5 ? 4
                                                           : 0;
        if (length == 0) return i;
        for (std::size_t k = 1; k < length; ++k)
            if ((byte(i + k) & 0xc0) != 0x80) return i;
        // Over-long forms, surrogates, and what lies beyond U+10FFFF.
        unsigned second = byte(i + 1);
        if ((lead == 0xe0 && second < 0xa0) || (lead == 0xed && second > 0x9f) ||
            (lead == 0xf0 && second < 0x90) || (lead == 0xf4 && second > 0x8f))
            return i;
        i += length;
    }
    return std::string_view::npos;
}

namespace {

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

struct Refused {
    std::size_t position;
    std::string message;
};

// Line and column of positions that are asked for in rising order.
class MarkCounter {
  public:
    explicit MarkCounter(std::string_view text) : text_(text) {
        if (text.starts_with(kByteOrderMark)) start_ = kByteOrderMark.size();
        position_ = start_;
    }
    Mark at(std::size_t position) {
        position = std::min(position, text_.size());
        if (position < position_) {
            position_ = start_;
            mark_ = {1, 1};
        }
        for (; position_ < position; ++position_) {
            if (text_[position_] == '\n')
                mark_ = {mark_.line + 1, 1};
            else if ((static_cast<unsigned char>(text_[position_]) & 0xc0) != 0x80)
                ++mark_.column;  // continuation bytes are no characters of their own
        }
        return mark_;
    }

  private:
    std::string_view text_;
    std::size_t start_ = 0, position_ = 0;
    Mark mark_{1, 1};
};

class TreeBuilder final : public YAML::EventHandler {
  public:
    TreeBuilder(std::string_view text, std::vector<Problem>& problems)
        : text_(text), marks_(text), problems_(problems) {
        // yaml-cpp counts its bytes from behind the byte order mark.
        if (text.starts_with(kByteOrderMark)) offset_ = consumed_ = kByteOrderMark.size();
    }

    YamlNode root;

    // What stands behind the last node must be blank, too.
    void finish() { pass_gap(text_.size()); }

    void OnDocumentStart(const YAML::Mark& mark) override {
        if (documents_++ > 0)
            throw Refused{
                position_of(mark),
                "a second document begins here; a graph is one document, remove the '---'"};
    }
    void OnDocumentEnd() override {}
    void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
        refuse_indicator(position_of(mark));
    }

    void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
        // The mark of a value that is left out is that of whatever comes next.
        std::size_t at = position_of(mark);
        YamlNode node;
        if (std::size_t length = null_length(at); length && at >= consumed_) {
            pass_gap(at);
            node = start(at);
            consumed_ = node.end = at + length;
        } else {
            std::size_t colon = skip_blank(text_, consumed_);
            bool there = colon < text_.size() && text_[colon] == ':';
            if (expects_value() && !there && !stack_.back().flow)
                throw Refused{stack_.back().keys.back().begin, "this key has no ':' behind it"};
            if (expects_value() && there) consumed_ = colon + 1;
            node = start(consumed_);
            node.end = consumed_;
        }
        add(std::move(node));
    }

    void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  const std::string& value) override {
        std::size_t at = position_of(mark);
        pass_gap(at);
        YamlNode node = start(at);
        char first = at < text_.size() ? text_[at] : '\0';
        bool plain = std::string_view("'\"|>").find(first) == std::string_view::npos;
        node.kind = plain ? YamlNode::Kind::plain : YamlNode::Kind::quoted;
        node.end = consumed_ = plain                           ? end_of_plain(at, value)
                               : first == '\'' || first == '"' ? end_of_quoted(at)
                                                               : end_of_block_text(at, value);
        node.text = value;
        add(std::move(node));
    }

    void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                         YAML::EmitterStyle::value style) override {
        open(mark, YamlNode::Kind::sequence, style == YAML::EmitterStyle::Flow);
    }
    void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                    YAML::EmitterStyle::value style) override {
        open(mark, YamlNode::Kind::map, style == YAML::EmitterStyle::Flow);
    }
    void OnSequenceEnd() override { close(); }
    void OnMapEnd() override {
        report_duplicates(stack_.back());
        close();
    }

  private:
    std::size_t position_of(const YAML::Mark& mark) const {
        return std::min(std::size_t(std::max(mark.pos, 0)) + offset_, text_.size());
    }

    bool expects_value() const {
        return !stack_.empty() && stack_.back().keys.size() > stack_.back().items.size();
    }

    YamlNode start(std::size_t at) {
        YamlNode node;
        node.begin = node.end = at;
        node.mark = marks_.at(at);
        return node;
    }

    void add(YamlNode node) {
        if (stack_.empty()) {
            root = std::move(node);
        } else if (stack_.back().kind == YamlNode::Kind::map && !expects_value()) {
            if (!node.is_scalar()) throw Refused{node.begin, "a key must be a name"};
            stack_.back().keys.push_back(std::move(node));
        } else {
            stack_.back().items.push_back(std::move(node));
        }
    }

    void open(const YAML::Mark& mark, YamlNode::Kind kind, bool flow) {
        std::size_t at = position_of(mark);
        pass_gap(at);
        if (stack_.size() >= kMaximumGraphDepth)
            throw Refused{
                at, fmt::format("lists and maps are nested more than {} deep", kMaximumGraphDepth)};
        char bracket = kind == YamlNode::Kind::map ? '{' : '[';
        if (flow && (at >= text_.size() || text_[at] != bracket))
            throw Refused{at, "a 'key: value' pair inside a list must stand in braces"};
        YamlNode node = start(at);
        node.kind = kind;
        node.flow = flow;
        if (flow) consumed_ = at + 1;
        stack_.push_back(std::move(node));
    }

    void close() {
        YamlNode node = std::move(stack_.back());
        stack_.pop_back();
        if (node.flow) {
            char bracket = node.kind == YamlNode::Kind::map ? '}' : ']';
            std::size_t at = skip_blank(text_, consumed_);
            while (at < text_.size() && (text_[at] == ',' || text_[at] == ':'))
                at = skip_blank(text_, at + 1);
            if (at >= text_.size() || text_[at] != bracket) refuse_indicator(at);
            consumed_ = at + 1;
        }
        node.end = consumed_;
        add(std::move(node));
    }

    void report_duplicates(const YamlNode& map) {
        std::vector<std::size_t> order(map.keys.size());
        std::iota(order.begin(), order.end(), std::size_t(0));
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            return map.keys[a].text < map.keys[b].text;
        });
        for (std::size_t i = 1; i < order.size(); ++i) {
            const YamlNode& first = map.keys[order[i - 1]];
            const YamlNode& second = map.keys[order[i]];
            if (first.text == second.text)
                problems_.push_back(
                    {second.mark,
                     {},
                     {},
                     fmt::format("key '{}' stands twice, here and in line {}; remove "
                                 "one of the two",
                                 second.text, first.mark.line)});
        }
    }

    // --- from events to ends
    // ----------------------------------------------------------------------

    // Between two nodes there are only white space, comments and indicators. Anything else is a
    // form of YAML that patching the text would not survive.
    void pass_gap(std::size_t to) {
        if (to < consumed_) refuse_indicator(to);
        for (std::size_t at = skip_blank(text_, consumed_); at < to; at = skip_blank(text_, at + 1))
            if (std::string_view("-:,[]{}.").find(text_[at]) == std::string_view::npos)
                refuse_indicator(at);
        if (to < text_.size() && std::string_view("&*!").find(text_[to]) != std::string_view::npos)
            refuse_indicator(to);
        consumed_ = to;
    }

    [[noreturn]] void refuse_indicator(std::size_t at) const {
        switch (at < text_.size() ? text_[at] : '\0') {
            case '&':
            case '*':
                throw Refused{at,
                              "anchors and aliases ('&', '*') are not supported in a graph; write "
                              "the value out, or put it in quotes if it is a text"};
            case '!':
                throw Refused{at,
                              "tags ('!') are not supported in a graph; remove it, or put the "
                              "value in quotes if it is a text"};
            case '%':
                throw Refused{at, "directives ('%') are not supported in a graph; remove the line"};
            case '?':
                throw Refused{
                    at, "keys written with '?' are not supported in a graph; write 'key: value'"};
            default:
                throw Refused{at,
                              "this form of YAML is not supported in a graph; write 'key: value' "
                              "lines, [lists] and {maps}"};
        }
    }

    std::size_t null_length(std::size_t at) const {
        for (std::string_view word : {"~", "null", "Null", "NULL"})
            if (text_.substr(at).starts_with(word)) return word.size();
        return 0;
    }

    // A plain scalar has no escapes: but for white space, which folds, its characters stand in the
    // text as they stand in the value.
    std::size_t end_of_plain(std::size_t at, std::string_view value) const {
        constexpr std::string_view blank = " \t\r\n";
        std::size_t end = at;
        for (char c : value) {
            if (blank.find(c) != std::string_view::npos) continue;
            while (at < text_.size() && blank.find(text_[at]) != std::string_view::npos) ++at;
            if (at >= text_.size() || text_[at] != c) refuse_indicator(at);
            end = ++at;
        }
        return end;
    }

    std::size_t end_of_quoted(std::size_t begin) const {
        char quote = text_[begin];
        for (std::size_t at = begin + 1; at < text_.size(); ++at) {
            if (quote == '"' && text_[at] == '\\') {
                ++at;
            } else if (text_[at] == quote) {
                if (quote == '"' || at + 1 >= text_.size() || text_[at + 1] != quote) return at + 1;
                ++at;  // '' stands for '
            }
        }
        throw Refused{begin, "this quoted text does not end"};
    }

    // '|' or '>': the following lines that are indented at least as far as the first of them.
    std::size_t end_of_block_text(std::size_t begin, std::string_view value) const {
        std::size_t line_end = std::min(text_.find('\n', begin), text_.size());
        std::string_view header = text_.substr(begin, line_end - begin);
        header = header.substr(0, header.find('#'));
        if (header.find_first_of("123456789") != std::string_view::npos)
            throw Refused{begin,
                          "a block text with an indentation number is not supported in a "
                          "graph; put the text in double quotes"};
        std::size_t end = line_end;
        if (end > begin && text_[end - 1] == '\r') --end;
        if (value.find_first_not_of('\n') == std::string_view::npos) return end;
        std::size_t indent = 0;
        while (line_end < text_.size()) {
            std::size_t line = line_end + 1;
            line_end = std::min(text_.find('\n', line), text_.size());
            std::size_t first = text_.find_first_not_of(' ', line);
            if (first >= line_end || text_[first] == '\r') continue;  // blank
            if (indent == 0) indent = first - line;
            if (first - line < indent || indent == 0) break;
            end = line_end;
            if (text_[end - 1] == '\r') --end;
        }
        return end;
    }

    std::string_view text_;
    MarkCounter marks_;
    std::vector<Problem>& problems_;
    std::vector<YamlNode> stack_;
    std::size_t offset_ = 0;    // of yaml-cpp's positions in the text
    std::size_t consumed_ = 0;  // everything before belongs to nodes that are complete
    int documents_ = 0;
};

// yaml-cpp takes these for line breaks, ends of file or other encodings.
std::size_t find_control_character(std::string_view text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
        unsigned char c = static_cast<unsigned char>(text[i]);
        bool line_end = c == '\r' && i + 1 < text.size() && text[i + 1] == '\n';
        if ((c < 0x20 && c != '\n' && c != '\t' && !line_end) || c == 0x7f) return i;
    }
    return std::string_view::npos;
}

}  // namespace

YamlNode parse_yaml(const std::string& text, std::vector<Problem>& problems) {
    auto refuse = [&](std::size_t position, std::string message) {
        problems.push_back({MarkCounter(text).at(position), {}, {}, std::move(message)});
        return YamlNode();
    };
    if (text.size() > kMaximumGraphBytes)
        return refuse(0, fmt::format("the text has {}, a graph has at most {}",
                                     human_bytes(double(text.size())),
                                     human_bytes(double(kMaximumGraphBytes))));
    if (std::size_t at = find_invalid_utf8(text); at != std::string::npos)
        return refuse(at, "this byte is not UTF-8; save the file in UTF-8");
    if (std::size_t at = find_control_character(text); at != std::string::npos)
        return refuse(at, fmt::format("a control character (0x{:02x}) stands here; remove it",
                                      static_cast<unsigned char>(text[at])));
    TreeBuilder builder(text, problems);
    try {
        std::istringstream stream(text);
        YAML::Parser parser(stream);
        while (parser.HandleNextDocument(builder)) {
        }
        builder.finish();
    } catch (const Refused& refused) {
        return refuse(refused.position, refused.message);
    } catch (const YAML::Exception& e) {
        const std::size_t offset = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
        const std::size_t position = std::min(std::size_t(std::max(e.mark.pos, 0)) + offset, text.size());
        if (const std::size_t tab = tab_in_indentation(text, position); tab < text.size())
            return refuse(tab, "this is not YAML: lines are indented with spaces, and here is a tab");
        return refuse(position, "this is not YAML: " + e.msg);
    }
    return std::move(builder.root);
}

}  // namespace voxloom
