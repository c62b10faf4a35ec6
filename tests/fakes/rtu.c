/* SPDX-License-Identifier: Apache-2.0 */
#include "fakes/rtu.h"

#include "fakes/must.h"

#include <string.h>

/* --- the wire --------------------------------------------------------------------------------- */

#define READ 0x03
#define WRITE 0x10
#define REFUSED 0x80
#define CRC 2
#define REQUEST 8       /* bytes of a read, and of the answer to a write */
#define REFUSAL 5       /* bytes of a refusal */
#define WRITE_HEAD 7    /* bytes before the values of a write */
#define ANSWER_HEAD 3   /* bytes before the values of an answer to a read */
#define BLOCK_PARAMS 30 /* that one read asks for */
#define BLOCKS (RTU_PARAMS / BLOCK_PARAMS)

/* Registers of a drive. */
enum {
	AT_COMMAND = 0,
	AT_STATUS = 16, /* status, position in two, speed, alarm */
	STATUS_WORDS = 5,
	AT_PARAMS = 1000,
};

enum { POWERED = 1u << 0, MOVES = 1u << 1, FAULT = 1u << 2 };

static uint16_t crc_of(const uint8_t *bytes, size_t length)
{
	uint16_t crc = 0xFFFF;

	for (size_t i = 0; i < length; i++) {
		crc ^= bytes[i];
		for (unsigned bit = 0; bit < 8; bit++)
			crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
	}
	return crc;
}

static void put_word(uint8_t *bytes, uint16_t word)
{
	bytes[0] = (uint8_t)(word >> 8);
	bytes[1] = (uint8_t)word;
}

static uint16_t word_at(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

static size_t end_frame(uint8_t *bytes, size_t length)
{
	uint16_t crc = crc_of(bytes, length);

	bytes[length] = (uint8_t)crc;
	bytes[length + 1] = (uint8_t)(crc >> 8);
	return length + CRC;
}

static bool is_whole(const uint8_t *bytes, size_t length)
{
	uint16_t crc = length > CRC ? crc_of(bytes, length - CRC) : 0;

	return length > CRC && bytes[length - 2] == (uint8_t)crc &&
	       bytes[length - 1] == (uint8_t)(crc >> 8);
}

/* --- the family: tables ----------------------------------------------------------------------- */

#define P1(n)                                                                            \
	{                                                                                \
		.name = "p" #n, .type = DB_I32, .unit = "", .min = -1000, .max = 100000, \
		.description = "A parameter"                                             \
	}
#define P10(n)                                                                                    \
	P1(n##0), P1(n##1), P1(n##2), P1(n##3), P1(n##4), P1(n##5), P1(n##6), P1(n##7), P1(n##8), \
		P1(n##9)
#define P100(n)                                                                                 \
	P10(n##0), P10(n##1), P10(n##2), P10(n##3), P10(n##4), P10(n##5), P10(n##6), P10(n##7), \
		P10(n##8), P10(n##9)

static const struct db_param params[RTU_PARAMS] = { P100(1), P100(2), P100(3) };

#define ALARM(n)                                                                         \
	{                                                                                \
		.error = 0x5100 + (n), .name = "module_" #n, .check = "check module " #n \
	}

static const struct db_drive_fault faults[RTU_FAULTS] = {
	{ RTU_LOW_ALARM, "regeneration", "check the braking resistor" },
	{ RTU_UNDERVOLTAGE, "dc_undervoltage", "check the mains" },
	{ RTU_OVERHEAT, "heat_sink", "clean the fan" },
	ALARM(1),
	ALARM(2),
	ALARM(3),
	ALARM(4),
	ALARM(5),
	ALARM(6),
	ALARM(7),
	ALARM(8),
	ALARM(9),
	ALARM(10),
	ALARM(11),
	ALARM(12),
	ALARM(13),
	ALARM(14),
	ALARM(15),
	ALARM(16),
	ALARM(17),
	ALARM(18),
	ALARM(19),
	ALARM(20),
	{ 0xFF01, "vendor_alarm", "see the drive's manual" },
};

/* --- the family: conversations ---------------------------------------------------------------- */

/* Beside that of the other family, which tests see. */
struct rtu_device {
	uint8_t address;
	db_time taken;
	uint16_t status;
	int32_t position;
	int16_t speed;
	uint16_t alarm;
	bool identified;
	struct db_nameplate plate;
	DB_NAMEPLATE_ROOM(RTU_PARAMS) room;
};

static struct rtu_device *rtu_of(struct db_device *device)
{
	return (void *)device;
}

static const struct rtu_device *seen(const struct db_device *device)
{
	return (const void *)device;
}

static void init(struct db_device *device, struct db_device *first, const struct db_bus_config *bus,
                 const struct db_drive_config *drive)
{
	(void)first;
	(void)bus;
	rtu_of(device)->address = (uint8_t)drive->address;
	DB_NAMEPLATE_INIT(&rtu_of(device)->plate, &rtu_of(device)->room, RTU_PARAMS);
}

static enum db_step say(struct db_conversation *talk, uint8_t function, uint16_t start,
                        uint16_t count, const uint16_t *values)
{
	uint8_t *bytes = talk->exchange->request;
	size_t length = REQUEST - CRC;

	bytes[0] = rtu_of(talk->device)->address;
	bytes[1] = function;
	put_word(bytes + 2, start);
	put_word(bytes + 4, count);
	if (function == WRITE) {
		bytes[6] = (uint8_t)(2 * count);
		for (uint16_t i = 0; i < count; i++)
			put_word(bytes + WRITE_HEAD + 2 * i, values[i]);
		length = WRITE_HEAD + 2u * count;
	}
	talk->exchange->request_length = end_frame(bytes, length);
	talk->exchange->answer_length = function == WRITE ? REQUEST :
	                                                    ANSWER_HEAD + 2u * count + CRC;
	talk->exchange->repeatable = true;
	talk->exchange->extra_time = 0;
	return DB_STEP_SEND;
}

static enum db_step read_block(struct db_conversation *talk)
{
	return say(talk, READ, (uint16_t)(AT_PARAMS + 2 * BLOCK_PARAMS * talk->job->step),
	           2 * BLOCK_PARAMS, NULL);
}

static enum db_step write_setting(struct db_conversation *talk)
{
	const struct db_setting *setting = &talk->job->request->settings[talk->job->step];
	const uint16_t words[] = { (uint16_t)(setting->value.u >> 16), (uint16_t)setting->value.u };

	return say(talk, WRITE, (uint16_t)(AT_PARAMS + 2 * setting->param), 2, words);
}

static enum db_step begin(struct db_conversation *talk)
{
	uint16_t command;

	talk->job->step = 0;
	switch (talk->job->kind) {
	case DB_JOB_IDENTIFY:
		return read_block(talk);
	case DB_JOB_SETTINGS:
		return write_setting(talk);
	case DB_JOB_COMMAND:
		command = (uint16_t)talk->job->request->command;
		return say(talk, WRITE, AT_COMMAND, 1, &command);
	default:
		return say(talk, READ, AT_STATUS, STATUS_WORDS, NULL);
	}
}

static enum db_step end(struct db_conversation *talk, enum db_result result)
{
	talk->result = result;
	return DB_STEP_DONE;
}

static void take_block(struct db_conversation *talk, const uint8_t *words)
{
	struct db_nameplate *plate = &rtu_of(talk->device)->plate;
	uint64_t told[DB_PARAM_WORDS(RTU_PARAMS)] = { 0 };

	for (size_t i = 0; i < BLOCK_PARAMS; i++) {
		size_t param = (size_t)talk->job->step * BLOCK_PARAMS + i;

		if (!words) {
			db_params_add(plate->missing, param);
			continue;
		}
		plate->values[param].u = (uint32_t)word_at(words + 4 * i) << 16 |
		                         word_at(words + 4 * i + 2);
		db_params_add(plate->valid, param);
		db_params_add(told, param);
	}
	db_nameplate_note_told(plate, told, talk->now);
	plate->generation++;
}

static enum db_step answer_settings(struct db_conversation *talk, bool refused)
{
	const struct db_setting *setting = &talk->job->request->settings[talk->job->step];
	struct db_nameplate *plate = &rtu_of(talk->device)->plate;

	if (refused)
		return end(talk, DB_RESULT_REFUSED);
	plate->values[setting->param] = setting->value;
	plate->generation++;
	if (++talk->job->step < talk->job->request->setting_count)
		return write_setting(talk);
	return end(talk, DB_RESULT_OK);
}

static enum db_step answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	struct rtu_device *device = rtu_of(talk->device);
	bool refused = frame[1] & REFUSED;

	if (length < REFUSAL || (frame[1] & ~REFUSED) != talk->exchange->request[1])
		return DB_STEP_IGNORE;
	switch (talk->job->kind) {
	case DB_JOB_IDENTIFY:
		take_block(talk, refused ? NULL : frame + ANSWER_HEAD);
		if (++talk->job->step < BLOCKS)
			return read_block(talk);
		device->identified = true;
		return end(talk, DB_RESULT_OK);
	case DB_JOB_SETTINGS:
		return answer_settings(talk, refused);
	case DB_JOB_COMMAND:
		return end(talk, refused ? DB_RESULT_REFUSED : DB_RESULT_OK);
	default:
		device->status = word_at(frame + ANSWER_HEAD);
		device->position = (int32_t)((uint32_t)word_at(frame + 5) << 16 |
		                             word_at(frame + 7));
		device->speed = (int16_t)word_at(frame + 9);
		device->alarm = word_at(frame + 11);
		device->taken = talk->now;
		return end(talk, DB_RESULT_OK);
	}
}

static enum db_step lost(struct db_conversation *talk)
{
	return end(talk, DB_RESULT_TIMEOUT);
}

static void feedback(const struct db_device *own, struct db_feedback *feedback)
{
	const struct rtu_device *device = seen(own);
	bool moves = device->status & MOVES;

	feedback->taken = device->taken;
	feedback->position = device->position;
	feedback->velocity = device->speed;
	feedback->drive_status = device->status;
	feedback->error = device->alarm;
	feedback->state = device->taken == 0 ? DB_AXIS_OFFLINE :
	                  device->alarm      ? DB_AXIS_ERROR_STOP :
	                  moves              ? DB_AXIS_CONTINUOUS_MOTION :
	                                       DB_AXIS_STANDSTILL;
	feedback->status = (device->identified ? DB_STATUS_PARAMS_VALID : 0) |
	                   (device->status & POWERED ? DB_STATUS_ENABLED : 0) |
	                   (device->alarm ? DB_STATUS_ERROR : 0) | (moves ? DB_STATUS_MOVING : 0);
}

static const struct db_nameplate *nameplate(const struct db_device *device)
{
	return &seen(device)->plate;
}

/* --- the family: its line --------------------------------------------------------------------- */

/*
 * The length of an answer follows from the question; what is not as long as that ends with the
 * silence after it, and is whole or garbage.
 */
static void cut(const struct db_received *received, size_t *skip, size_t *length)
{
	const uint8_t *question = received->question;
	size_t expected = 0;

	*skip = *length = 0;
	if (received->available >= 2 && received->bytes[1] & REFUSED)
		expected = REFUSAL;
	else if (question && question[1] == READ)
		expected = ANSWER_HEAD + 2u * word_at(question + 4) + CRC;
	else if (question && question[1] == WRITE)
		expected = REQUEST;
	if (expected > 0 && received->available >= expected && is_whole(received->bytes, expected))
		*length = expected;
	else if (received->silence >= RTU_SILENCE && is_whole(received->bytes, received->available))
		*length = received->available;
	else if (received->silence >= RTU_SILENCE)
		*skip = received->available;
}

static db_time frame_silence(const struct db_bus_config *bus)
{
	(void)bus;
	return RTU_SILENCE;
}

static enum db_frame accept_frame(const struct db_bus_config *bus, const uint8_t *frame,
                                  size_t length, int *address)
{
	(void)bus;
	*address = frame[0];
	return is_whole(frame, length) ? DB_FRAME_GOOD : DB_FRAME_BAD;
}

static db_time exchange_time(const struct db_bus_config *bus)
{
	(void)bus;
	return 2 * RTU_ANSWER_TIME;
}

#define COMMANDS                                                                       \
	(DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |              \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |             \
	 DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) | \
	 DB_COMMAND_BIT(DB_CMD_HOME) | DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT))

const struct db_driver rtu_family = {
	.name = "fake-rtu",
	.title = "Servo drives on Modbus RTU",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = 247,
	.default_baud = 115200,
	.commands = COMMANDS,
	.acknowledges = true,
	.params = params,
	.param_count = RTU_PARAMS,
	.param_page = RTU_PARAM_PAGE,
	.acceleration_param = 250,
	.deceleration_param = -1,
	.preset_velocity_param = -1,
	.faults = faults,
	.fault_count = RTU_FAULTS,
	.poll_time = exchange_time,
	.command_time = exchange_time,
	.device_size = sizeof(struct rtu_device),
	.init = init,
	.cut = cut,
	.frame_silence = frame_silence,
	.accept = accept_frame,
	.begin = begin,
	.answer = answer,
	.lost = lost,
	.feedback = feedback,
	.nameplate = nameplate,
};

/* --- the drives ------------------------------------------------------------------------------- */

static size_t read_registers(const struct rtu_drive *drive, uint16_t start, uint16_t count,
                             uint8_t *bytes)
{
	const uint16_t status[STATUS_WORDS] = {
		(uint16_t)((drive->powered ? POWERED : 0) | (drive->speed ? MOVES : 0) |
		           (drive->alarm ? FAULT : 0)),
		(uint16_t)((uint32_t)drive->position >> 16),
		(uint16_t)drive->position,
		(uint16_t)drive->speed,
		drive->alarm,
	};

	if (start == AT_STATUS) {
		must(count == STATUS_WORDS);
		for (size_t i = 0; i < STATUS_WORDS; i++)
			put_word(bytes + 2 * i, status[i]);
		memset(bytes + 2 * sizeof status, 0, 4);
		return sizeof status + (drive->long_answers ? 4 : 0);
	}
	must(start >= AT_PARAMS && start % 2 == 0 && count % 2 == 0);
	for (uint16_t i = 0; i < count / 2; i++) {
		uint16_t param = (uint16_t)((start - AT_PARAMS) / 2 + i);

		must(param < RTU_PARAMS);
		if (drive->lacks_last && param >= 240)
			return 0;
		put_word(bytes + 4 * i, (uint16_t)((uint32_t)drive->params[param] >> 16));
		put_word(bytes + 4 * i + 2, (uint16_t)drive->params[param]);
	}
	return 2u * count;
}

static void obey(struct rtu_drive *drive, uint16_t command)
{
	drive->command = command;
	switch (command) {
	case DB_CMD_ENABLE:
		drive->powered = true;
		break;
	case DB_CMD_DISABLE:
		drive->powered = false;
		drive->speed = 0;
		break;
	case DB_CMD_MOVE_VELOCITY:
		drive->speed = 100;
		break;
	case DB_CMD_CLEAR_FAULT:
		drive->alarm = 0;
		break;
	default:
		drive->speed = 0;
		break;
	}
}

static void write_registers(struct rtu_drive *drive, uint16_t start, const uint8_t *words)
{
	if (start == AT_COMMAND) {
		obey(drive, word_at(words));
		return;
	}
	must(start >= AT_PARAMS);
	drive->params[(start - AT_PARAMS) / 2] = (int32_t)((uint32_t)word_at(words) << 16 |
	                                                   word_at(words + 2));
	drive->writes++;
}

void rtu_write_broadcast(struct db_exchange *exchange, uint8_t kind, uint32_t number)
{
	exchange->request[0] = 0;
	exchange->request[1] = kind;
	put_word(exchange->request + 2, (uint16_t)(number >> 16));
	put_word(exchange->request + 4, (uint16_t)number);
	exchange->request_length = end_frame(exchange->request, 6);
}

/* Nothing is said after a frame that is addressed to nobody here. */
static db_time hear(void *context, const uint8_t *bytes, size_t length)
{
	struct rtu_drives *drives = context;
	struct fake_bus *bus = drives->plant.bus;
	struct rtu_drive *drive;
	uint8_t answer[FAKE_ANSWER_MAX];
	size_t answered = 2;

	must(is_whole(bytes, length) && bytes[0] <= RTU_DRIVES);
	if (bytes[0] == 0) {
		must(bytes[1] < RTU_KINDS);
		drives->broadcasts[bytes[1]]++;
		drives->last_number = (uint32_t)word_at(bytes + 2) << 16 | word_at(bytes + 4);
		return bus->now;
	}
	drive = &drives->drives[bytes[0] - 1];
	if (drive->gone)
		return bus->now;
	memcpy(answer, bytes, 6);
	if (bytes[1] == READ) {
		answered = read_registers(drive, word_at(bytes + 2), word_at(bytes + 4),
		                          answer + ANSWER_HEAD);
		answer[2] = (uint8_t)answered;
		answered += ANSWER_HEAD;
	} else {
		write_registers(drive, word_at(bytes + 2), bytes + WRITE_HEAD);
		answered = 6;
	}
	if (answered == ANSWER_HEAD) {
		answer[1] |= REFUSED;
		answer[2] = 2;
	}
	answered = end_frame(answer, answered);
	fake_answer_after(bus, RTU_ANSWER_TIME, answer, answered);
	return bus->now;
}

static const struct db_engine_ops ops = { .send = hear };

void rtu_open(struct rtu_drives *drives, const struct db_driver *driver, size_t count)
{
	must(count <= RTU_DRIVES);
	fake_plant_open(&drives->plant, driver, count, &ops, drives);
}

void rtu_close(struct rtu_drives *drives)
{
	fake_plant_close(&drives->plant);
}
