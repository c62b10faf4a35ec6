-- SPDX-License-Identifier: Apache-2.0
--
-- Shows traces of drivebridge in words: drivebridgectl trace BUS --output FILE.pcapng.
--
-- A packet of a serial line (LINKTYPE_USER0) is described in src/tools/capture/pcapng.h of the
-- sources. A frame of CAN is shown by Wireshark itself; its words are in its comment.
--
-- Wireshark reads this file from its folder of plugins (Help, About, Folders: "Personal Lua
-- Plugins"), tshark also with: tshark -X lua_script:drivebridge.lua -r FILE.pcapng

local VERSION = 1

local line = Proto("drivebridge", "Serial line with drives")
local directions = { [0] = "none", [1] = "sent", [2] = "received" }
local arrows = { [0] = "=", [1] = ">", [2] = "<" }

local f = {
	version = ProtoField.uint8("drivebridge.version", "Version of this form"),
	direction = ProtoField.uint8("drivebridge.direction", "Direction", base.DEC, directions),
	family = ProtoField.string("drivebridge.family", "Family"),
	kind = ProtoField.string("drivebridge.kind", "Kind"),
	words = ProtoField.string("drivebridge.words", "Words"),
	bytes = ProtoField.bytes("drivebridge.bytes", "Bytes on the line"),
}
line.fields = { f.version, f.direction, f.family, f.kind, f.words, f.bytes }

local malformed = ProtoExpert.new("drivebridge.malformed", "Not a packet of drivebridge",
	expert.group.MALFORMED, expert.severity.ERROR)
line.experts = { malformed }

-- The range of a text and the place after it; nil when it is not all there.
local function text_at(buffer, at)
	if at + 2 > buffer:len() then
		return nil
	end
	local length = buffer(at, 2):uint()
	if at + 2 + length > buffer:len() then
		return nil
	end
	-- A range of no bytes cannot be made.
	return length > 0 and buffer(at + 2, length) or buffer(at, 2), length, at + 2 + length
end

function line.dissector(buffer, pinfo, tree)
	local root = tree:add(line, buffer())
	local texts = {}
	local at = 2

	pinfo.cols.protocol = "drive"
	if buffer:len() < 2 or buffer(0, 1):uint() ~= VERSION then
		root:add_proto_expert_info(malformed)
		return
	end
	root:add(f.version, buffer(0, 1))
	root:add(f.direction, buffer(1, 1))
	for _, name in ipairs({ "family", "kind", "words" }) do
		local range, length, after = text_at(buffer, at)

		if not range then
			root:add_proto_expert_info(malformed)
			return
		end
		texts[name] = length > 0 and range:string(ENC_UTF_8) or ""
		root:add(f[name], range, texts[name])
		at = after
	end
	if at < buffer:len() then
		root:add(f.bytes, buffer(at))
	end
	pinfo.cols.protocol = texts.family
	pinfo.cols.src = buffer(1, 1):uint() == 2 and "drive" or "gateway"
	pinfo.cols.dst = buffer(1, 1):uint() == 1 and "drive" or "gateway"
	pinfo.cols.info = string.format("%s %s  %s", arrows[buffer(1, 1):uint()] or "?", texts.kind,
		texts.words)
	root:append_text(", " .. texts.words)
end

DissectorTable.get("wtap_encap"):add(wtap.USER0, line)

-- CAN: the words are put in front of what Wireshark says of the frame.
local can = Proto("drivebridge_can", "CAN with drives")
local comment = Field.new("frame.comment")
local can_id = Field.new("can.id")
local can_words = ProtoField.string("drivebridge_can.words", "Words")
can.fields = { can_words }

function can.dissector(_, pinfo, tree)
	local words = comment()

	if words and can_id() then
		tree:add(can):add(can_words, words.value)
		pinfo.cols.info = words.value
	end
end

register_postdissector(can)
