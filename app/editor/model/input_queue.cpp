#include "app/editor/model/input_queue.h"

#include <algorithm>

namespace voxloom::editor {

using Kind = InputEvent::Kind;

namespace {

// Whether a frame that was given `before` can be given `next` as well.
bool go_together(const std::vector<InputEvent>& before, const InputEvent& next) {
    return std::ranges::none_of(before, [&](const InputEvent& b) {
        const bool same_key = b.kind == Kind::key && next.kind == Kind::key && b.code == next.code;
        switch (next.kind) {
            case Kind::text: return false;  // comes behind its key
            case Kind::key: return b.kind == Kind::button || same_key || (b.kind == Kind::key && b.down);
            case Kind::button: return (b.kind == Kind::button && b.code == next.code) || b.kind == Kind::wheel || (b.kind == Kind::key && !b.down);
            // Of a wheel that turns while the pointer moves frames are not to lag behind.
            case Kind::wheel:
            case Kind::pointer: return b.kind == Kind::button || b.kind == Kind::key;
        }
        return false;
    });
}

}  // namespace

void InputQueue::add(const InputEvent& event) { events_.push_back(event); }

std::vector<InputEvent> InputQueue::next_frame() {
    std::vector<InputEvent> frame;
    const bool keys_wait = waiting_ > 0;
    waiting_ = std::max(waiting_ - 1, 0);
    for (; !events_.empty() && go_together(frame, events_.front()); events_.pop_front()) {
        const InputEvent& event = events_.front();
        const bool is_press = event.kind == Kind::key && event.down;
        if (keys_wait && is_press) break;
        if (event.kind == Kind::text && event.repeated && silent_.contains(event.typed_by)) continue;
        if (is_press) down_.insert(event.code);
        if (event.kind == Kind::key && !event.down) down_.erase(event.code), silent_.erase(event.code);
        frame.push_back(event);
    }
    return frame;
}

void InputQueue::wait_for_texts() {
    waiting_ = kFramesToOpen;
    silent_ = down_;
}

}  // namespace voxloom::editor
