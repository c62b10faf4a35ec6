/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD steppers on RS232 and RS485. Every command is answered by exactly one frame, whose status
 * word tells whether the drive took it (cmd_wrg); that answer is the confirmation.
 *
 * Source: VSMD custom protocol for RS232 & RS485, sections 2 and 3.
 */
#include "driver/list.h"
#include "driver/vsmd/axis.h"
#include "transport/serial.h"

#include <math.h>
#include <string.h>

/* Answers the document gives no length for: identity text, and all parameters as text. */
#define IDENTITY_FRAME 64
#define PARAMS_FRAME 1000

/* What a drive usually needs before it starts to answer; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

/* A number that comes back differs from the one written by no more: absolute, and of the number. */
#define PRINTED_STEP 0.0051
#define PRINTED_SHARE 1e-5

static const struct db_option options[] = { VSMD_DRIVE_OPTIONS };

struct db_device {
	struct vsmd_axis axis; /* first: the link is given this */
	int id;
};

/* --- exchanges ------------------------------------------------------------------------------- */

static enum db_step ask(int id, const struct vsmd_command *command, bool repeatable,
                        struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_command addressed = *command;
	int length;

	addressed.id = id;
	length = vsmd_serial_encode_command(&addressed, (char *)exchange->request,
	                                    exchange->request_size);
	if (length < 0) {
		*result = DB_RESULT_OUT_OF_RANGE;
		return DB_STEP_DONE;
	}
	exchange->request_length = (size_t)length;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	switch (command->verb) {
	case VSMD_DEV:
		exchange->answer_length = IDENTITY_FRAME;
		break;
	case VSMD_SAV:
	case VSMD_CFG_READ:
		exchange->answer_length = PARAMS_FRAME;
		break;
	default:
		exchange->answer_length = VSMD_SERIAL_STATUS_FRAME;
		break;
	}
	return DB_STEP_SEND;
}

static enum db_step link_look(struct vsmd_axis *axis, enum vsmd_look look,
                              struct db_exchange *exchange, enum db_result *result)
{
	const struct db_device *device = (const struct db_device *)axis;

	(void)look; /* every answer has all of it */
	return ask(device->id, &(struct vsmd_command){ .verb = VSMD_STS }, true, exchange, result);
}

static enum db_step link_ask(struct vsmd_axis *axis, const struct vsmd_command *command,
                             bool repeatable, struct db_exchange *exchange, enum db_result *result)
{
	const struct db_device *device = (const struct db_device *)axis;

	enum db_step step = ask(device->id, command, repeatable, exchange, result);

	if (command->verb == VSMD_SAV)
		exchange->extra_time = axis->save_time;
	return step;
}

static const struct vsmd_link serial_link = {
	.acknowledges = true,
	.shake_frequency_min = VSMD_SHAKE_FREQ_MIN,
	.first_option = 0,
	.ask = link_ask,
	.look = link_look,
};

static enum db_result serial_check(const struct db_bus_config *bus,
                                   const struct db_drive_config *drive, enum db_command command,
                                   const struct db_args *args)
{
	(void)bus;
	(void)drive;
	return vsmd_check(&serial_link, command, args);
}

static enum db_result serial_check_param(const struct db_bus_config *bus, size_t param,
                                         union db_value value)
{
	(void)bus;
	if (param >= VSMD_SERIAL_PARAM_COUNT)
		return DB_RESULT_UNSUPPORTED;
	return vsmd_param_in_range((enum vsmd_param)param, value) ? DB_RESULT_OK :
	                                                            DB_RESULT_OUT_OF_RANGE;
}

static enum db_step ask_verb(const struct db_device *device, enum vsmd_verb verb,
                             struct db_exchange *exchange, enum db_result *result)
{
	return ask(device->id, &(struct vsmd_command){ .verb = verb }, true, exchange, result);
}

static enum db_step done(enum db_result *result, enum db_result value)
{
	*result = value;
	return DB_STEP_DONE;
}

/* The line before may have lost its end: a bare one keeps this line from being glued to it. */
static void end_line_before(struct db_exchange *exchange)
{
	if (exchange->request_length + 1 > exchange->request_size)
		return;
	memmove(exchange->request + 1, exchange->request, exchange->request_length);
	exchange->request[0] = '\n';
	exchange->request_length++;
}

/* --- beginning a job --------------------------------------------------------------------------- */

static enum db_step begin_settings(struct db_device *device, const struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_setting settings[DB_SETTINGS_MAX];

	for (size_t i = 0; i < job->request->setting_count; i++) {
		settings[i].param = (enum vsmd_param)job->request->settings[i].param;
		settings[i].value = job->request->settings[i].value;
	}
	return ask(device->id,
	           &(struct vsmd_command){ .verb = VSMD_CFG_WRITE,
	                                   .settings = settings,
	                                   .setting_count = job->request->setting_count },
	           true, exchange, result);
}

/* The text of all parameters cannot be cut short, and a stop would wait behind it. */
static bool may_read_parameters(const struct vsmd_axis *axis)
{
	return axis->heard && (axis->last.status & VSMD_ST_STP);
}

/* One that moves is asked only if nothing is known of it yet: as after a restart of this program. */
static bool may_identify(const struct vsmd_axis *axis)
{
	return may_read_parameters(axis) || axis->plate.valid == 0;
}

static enum db_step begin_job(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		return ask_verb(device, VSMD_DEV, exchange, result);
	case DB_JOB_IDENTIFY:
		if (device->axis.heard && !may_identify(&device->axis))
			return done(result, DB_RESULT_BUSY);
		return ask_verb(device, VSMD_DEV, exchange, result);
	case DB_JOB_POLL:
		return ask_verb(device, VSMD_STS, exchange, result);
	case DB_JOB_SETTINGS:
		return begin_settings(device, job, exchange, result);
	case DB_JOB_COMMAND:
	default:
		if (job->request->command == DB_CMD_READ_PARAMETERS)
			return ask_verb(device, VSMD_DEV, exchange, result);
		return vsmd_begin_command(&device->axis, job, exchange, result);
	}
}

static enum db_step serial_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;
	enum db_step step;

	job->step = VSMD_FIRST;
	step = begin_job(device, job, exchange, result);
	if (step == DB_STEP_SEND && job->out_of_step)
		end_line_before(exchange);
	return step;
}

/* --- answers ----------------------------------------------------------------------------------- */

static void take_params(struct vsmd_axis *axis, const struct vsmd_reply *reply)
{
	struct vsmd_setting setting;
	size_t cursor = 0;
	int found;

	axis->plate.valid = 0;
	while ((found = vsmd_serial_next_param(reply->text, reply->text_length, &cursor,
	                                       &setting)) != 0) {
		if (found != 1)
			continue;
		axis->plate.values[setting.param] = setting.value;
		axis->plate.valid |= UINT64_C(1) << setting.param;
	}
	axis->plate.generation++;
	axis->plate.doubtful = false;
	axis->params_valid = true;
}

/* Drives print numbers with as few as two decimals. */
static bool is_written(enum vsmd_param param, union db_value held, union db_value written)
{
	if (vsmd_params[param].type != DB_F32)
		return held.u == written.u;
	return fabs((double)held.f - (double)written.f) <=
	       PRINTED_STEP + PRINTED_SHARE * fabs((double)written.f);
}

/* How what the drive holds compares with what was written. */
static enum db_result compare_settings(const struct vsmd_axis *axis,
                                       const struct db_request *request)
{
	enum db_result result = DB_RESULT_OK;

	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];

		if (!(axis->plate.valid >> setting->param & 1))
			result = DB_RESULT_UNPROVEN;
		else if (!is_written((enum vsmd_param)setting->param,
		                     axis->plate.values[setting->param], setting->value))
			return DB_RESULT_REFUSED;
	}
	return result;
}

/*
 * What does the drive hold now? While it moves that is not asked. Of a line that it refused, too: it may
 * have taken a part of it, or refuse to be told what it holds already.
 *
 * scratch[0]: it refused the line.
 */
static enum db_step settings_taken(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_axis *axis = &device->axis;

	axis->refused = (axis->last.status & VSMD_ST_CMD_WRG) != 0;
	job->scratch[0] = axis->refused;
	if (axis->refused && !may_read_parameters(axis)) {
		/* Which of several settings it took is unknown: read all of them again. */
		axis->plate.doubtful |= job->request->setting_count > 1;
		return done(result, DB_RESULT_REFUSED);
	}
	if (!may_read_parameters(axis)) {
		vsmd_take_settings(axis, job->request);
		axis->plate.doubtful = true;
		return done(result, DB_RESULT_UNPROVEN);
	}
	job->step++;
	return ask_verb(device, VSMD_CFG_READ, exchange, result);
}

/* FIRST: written, SECOND: read back. THIRD and READ_BACK: the same again, as requests carry no checksum
 * and a line may have come damaged. */
static enum db_step answer_settings(struct db_device *device, struct db_job *job,
                                    const struct vsmd_reply *reply, struct db_exchange *exchange,
                                    enum db_result *result)
{
	struct vsmd_axis *axis = &device->axis;
	enum db_result compared;

	if (job->step == VSMD_FIRST || job->step == VSMD_THIRD)
		return settings_taken(device, job, exchange, result);
	take_params(axis, reply);
	compared = compare_settings(axis, job->request);
	if (job->scratch[0]) {
		axis->refused = compared != DB_RESULT_OK;
		return done(result, axis->refused ? DB_RESULT_REFUSED : DB_RESULT_OK);
	}
	if (compared == DB_RESULT_REFUSED && job->step == VSMD_SECOND) {
		job->step = VSMD_THIRD;
		return begin_settings(device, job, exchange, result);
	}
	axis->refused = compared == DB_RESULT_REFUSED;
	return done(result, compared);
}

static enum db_step answer_identify(struct db_device *device, struct db_job *job,
                                    const struct vsmd_reply *reply, struct db_exchange *exchange,
                                    enum db_result *result)
{
	if (job->step == VSMD_FIRST) {
		vsmd_take_identity(&device->axis, reply->text, reply->text_length);
		job->step = VSMD_SECOND;
		if (job->kind == DB_JOB_IDENTIFY && !may_identify(&device->axis))
			return done(result, DB_RESULT_BUSY);
		return ask_verb(device, VSMD_CFG_READ, exchange, result);
	}
	take_params(&device->axis, reply);
	return done(result, DB_RESULT_OK);
}

static enum db_step answer_save(struct vsmd_axis *axis, const struct vsmd_reply *reply,
                                enum db_result *result)
{
	if (reply->code == VSMD_REPLY_PARAMS) {
		take_params(axis, reply);
		return done(result, DB_RESULT_OK);
	}
	return done(result, reply->status.status & VSMD_ST_FLASH_ERR ? DB_RESULT_FAILED :
	                                                               DB_RESULT_REFUSED);
}

static enum db_step answer_command(struct db_device *device, struct db_job *job,
                                   const struct vsmd_reply *reply, struct db_exchange *exchange,
                                   enum db_result *result)
{
	switch (job->request->command) {
	case DB_CMD_READ_PARAMETERS:
		return answer_identify(device, job, reply, exchange, result);
	case DB_CMD_SAVE_PARAMETERS:
		return answer_save(&device->axis, reply, result);
	default:
		return vsmd_answer_command(&device->axis, job, exchange, result);
	}
}

/* Which reply code the exchange on the wire must bring. */
static bool expected(const struct db_job *job, enum vsmd_reply_code code)
{
	enum db_command command = job->request ? job->request->command : DB_CMD_NONE;

	switch (job->kind) {
	case DB_JOB_PROBE:
		return code == VSMD_REPLY_IDENTITY;
	case DB_JOB_COMMAND:
		if (command == DB_CMD_SAVE_PARAMETERS)
			return code == VSMD_REPLY_PARAMS || code == VSMD_REPLY_STATUS;
		if (command != DB_CMD_READ_PARAMETERS)
			return code == VSMD_REPLY_STATUS;
		/* fall through */
	case DB_JOB_IDENTIFY:
		return code == (job->step == VSMD_FIRST ? VSMD_REPLY_IDENTITY : VSMD_REPLY_PARAMS);
	case DB_JOB_SETTINGS:
		return code == (job->step == VSMD_SECOND || job->step == VSMD_READ_BACK ?
		                        VSMD_REPLY_PARAMS :
		                        VSMD_REPLY_STATUS);
	default:
		return code == VSMD_REPLY_STATUS;
	}
}

static enum db_step serial_answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	db_time now = talk->now;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;
	struct vsmd_axis *axis = &device->axis;
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK ||
	    !expected(job, reply.code))
		return DB_STEP_IGNORE;
	if (reply.code == VSMD_REPLY_STATUS) {
		vsmd_take_status(axis, &reply.status, now);
		if (job->kind == DB_JOB_COMMAND && !db_command_is_stop(job->request->command))
			vsmd_take_speed(axis, reply.status.velocity);
	}
	switch (job->kind) {
	case DB_JOB_PROBE:
		vsmd_take_identity(axis, reply.text, reply.text_length);
		return done(result, DB_RESULT_OK);
	case DB_JOB_IDENTIFY:
		return answer_identify(device, job, &reply, exchange, result);
	case DB_JOB_POLL:
		vsmd_follow_motion(axis);
		return done(result, DB_RESULT_OK);
	case DB_JOB_SETTINGS:
		return answer_settings(device, job, &reply, exchange, result);
	case DB_JOB_COMMAND:
	default:
		return answer_command(device, job, &reply, exchange, result);
	}
}

static enum db_step serial_lost(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	return vsmd_lost(&device->axis, job, exchange, result);
}

/* --- state ------------------------------------------------------------------------------------- */

static void serial_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	vsmd_axis_feedback(&device->axis, feedback);
}

static void serial_gone(struct db_device *device)
{
	vsmd_axis_gone(&device->axis);
}

static const struct db_nameplate *serial_nameplate(const struct db_device *device)
{
	return &device->axis.plate;
}

static void serial_init(struct db_device *device, struct db_device *first,
                        const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first; /* one drive an address */
	vsmd_axis_init(&device->axis, &serial_link, bus, drive);
	device->id = bus->line == DB_LINE_RS232 ? VSMD_SERIAL_NO_ID : (int)drive->address;
}

/* --- the bus's side ---------------------------------------------------------------------------- */

static void serial_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	*length = 0;
	if (vsmd_serial_cut(bytes, available, skip, length) != VSMD_CUT_FRAME)
		*length = 0;
}

static enum db_frame serial_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                   size_t length, int *address)
{
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_FRAME_BAD;
	/* On RS232 there is one drive, and what id it gives differs. */
	*address = bus->line == DB_LINE_RS232 ? -1 : reply.id;
	return DB_FRAME_GOOD;
}

static db_time time_of(const struct db_bus_config *bus, size_t request, size_t answer)
{
	return db_serial_wire_time(bus, request + answer) + TYPICAL_LATENCY +
	       (db_time)bus->turnaround_us * DB_NS_PER_US;
}

static db_time serial_poll_time(const struct db_bus_config *bus)
{
	return time_of(bus, strlen("32 sts\n"), VSMD_SERIAL_STATUS_FRAME);
}

static db_time serial_command_time(const struct db_bus_config *bus)
{
	return time_of(bus, strlen("32 pos -2147483648 spd=192000.5\n"), VSMD_SERIAL_STATUS_FRAME);
}

static bool serial_broadcast(enum db_command command, const struct db_bus_config *bus,
                             struct db_exchange *exchange)
{
	const struct db_args none = { 0 };
	struct vsmd_command said = vsmd_command_of(command, &none);
	enum db_result result;

	if (bus->line != DB_LINE_RS485 ||
	    !(db_command_is_stop(command) || command == DB_CMD_ENABLE))
		return false;
	if (ask(VSMD_SERIAL_BROADCAST, &said, false, exchange, &result) != DB_STEP_SEND)
		return false;
	exchange->answer_length = 0;
	return true;
}

/* The same line, for everybody. */
static bool serial_begin_all(const struct db_device *device, const struct db_exchange *prepared,
                             struct db_exchange *all)
{
	const uint8_t *line = prepared->request;
	const uint8_t *end = line + prepared->request_length;
	const uint8_t *blank;

	while (line < end && *line == '\n')
		line++;
	blank = memchr(line, ' ', (size_t)(end - line));
	if (device->id == VSMD_SERIAL_NO_ID || !blank ||
	    (size_t)(end - blank) + 1 > all->request_size)
		return false;
	all->request[0] = '0' + VSMD_SERIAL_BROADCAST;
	memcpy(all->request + 1, blank, (size_t)(end - blank));
	all->request_length = (size_t)(end - blank) + 1;
	all->answer_length = 0;
	return true;
}

static enum db_step serial_begun_by_all(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	return vsmd_begun_by_all(&device->axis, exchange, result);
}

const struct db_driver db_driver_vsmd_serial = {
	.name = "vsmd-serial",
	.title = "VSMD stepper on RS485 or RS232",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = VSMD_SERIAL_ID_MAX,
	.default_baud = 9600,
	.acknowledges = true,
	.options = options,
	.option_count = sizeof options / sizeof options[0],
	.commands = VSMD_COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS,
	.output_count = 6,
	.params = vsmd_params,
	.param_count = VSMD_SERIAL_PARAM_COUNT,
	.status_bits = vsmd_status_bits,
	.status_bit_count = VSMD_STATUS_BITS,
	.param_page = 0,
	.acceleration_param = VSMD_ACC,
	.deceleration_param = VSMD_DEC,
	.preset_velocity_param = VSMD_SPD,
	.check = serial_check,
	.check_param = serial_check_param,
	.input_ports = vsmd_input_ports,
	.poll_time = serial_poll_time,
	.command_time = serial_command_time,
	.device_size = sizeof(struct db_device),
	.init = serial_init,
	.cut = serial_cut,
	.accept = serial_accept,
	.begin = serial_begin,
	.answer = serial_answer,
	.lost = serial_lost,
	.gone = serial_gone,
	.feedback = serial_feedback,
	.nameplate = serial_nameplate,
	.broadcast = serial_broadcast,
	.begin_all = serial_begin_all,
	.begun_by_all = serial_begun_by_all,
};
