/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD steppers on RS232 and RS485. Every command is answered by exactly one frame, whose status
 * word tells whether the drive took it (cmd_wrg); that answer is the confirmation.
 *
 * Source: VSMD custom protocol for RS232 & RS485, sections 2 and 3.
 */
#include "transport/serial.h"
#include "codec/vsmd_serial_describe.h"
#include "codec/vsmd_serial_frames.h"
#include "driver/list.h"
#include "driver/vsmd/commands.h"
#include "driver/vsmd/serial_inquiry.h"

#include <math.h>
#include <string.h>

/* What a drive usually needs before it starts to answer; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

/* A number that comes back differs from the one written by no more: absolute, and of the number. */
#define PRINTED_STEP 0.0051
#define PRINTED_SHARE 1e-5

static const struct db_option options[] = { VSMD_DRIVE_OPTIONS };

struct db_device {
	struct vsmd_axis axis; /* first: see axis_of() */
	int id;
	bool refused_line; /* it refused the settings that were written last */
};

/* --- exchanges ------------------------------------------------------------------------------- */

static bool write_line(int id, const struct vsmd_command *command, bool repeatable,
                       struct db_exchange *exchange)
{
	struct vsmd_command addressed = *command;
	int length;

	addressed.id = id;
	length = vsmd_serial_encode_command(&addressed, (char *)exchange->request,
	                                    exchange->request_size);
	if (length < 0)
		return false;
	exchange->request_length = (size_t)length;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	exchange->open_ended = command->verb == VSMD_SAV || command->verb == VSMD_CFG_READ;
	switch (command->verb) {
	case VSMD_DEV:
		exchange->answer_length = VSMD_IDENTITY_FRAME;
		break;
	case VSMD_SAV:
	case VSMD_CFG_READ:
		exchange->answer_length = VSMD_PARAMS_FRAME;
		break;
	default:
		exchange->answer_length = VSMD_SERIAL_STATUS_FRAME;
		break;
	}
	return true;
}

static enum db_step say_line(struct db_conversation *talk, const struct vsmd_command *command,
                             bool repeatable)
{
	if (!write_line(talk->device->id, command, repeatable, talk->exchange))
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	if (command->verb == VSMD_SAV)
		talk->exchange->extra_time = talk->device->axis.save_time;
	return DB_STEP_SEND;
}

static enum db_step say_identity(struct db_conversation *talk)
{
	return say_line(talk, &(struct vsmd_command){ .verb = VSMD_DEV }, true);
}

static enum db_step say_status(struct db_conversation *talk)
{
	return say_line(talk, &(struct vsmd_command){ .verb = VSMD_STS }, true);
}

static enum db_step say_parameters(struct db_conversation *talk)
{
	return say_line(talk, &(struct vsmd_command){ .verb = VSMD_CFG_READ }, true);
}

static enum db_step say_settings(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;
	struct vsmd_setting settings[DB_SETTINGS_MAX];

	for (size_t i = 0; i < request->setting_count; i++) {
		settings[i].param = (enum vsmd_param)request->settings[i].param;
		settings[i].value = request->settings[i].value;
	}
	return say_line(talk,
	                &(struct vsmd_command){ .verb = VSMD_CFG_WRITE,
	                                        .settings = settings,
	                                        .setting_count = request->setting_count },
	                true);
}

/* --- the steps --------------------------------------------------------------------------------- */

/* Of all jobs but the commands in commands.h. */
enum step {
	STEP_PROBE,
	STEP_POLL,
	STEP_IDENTITY,
	STEP_PARAMETERS,
	STEP_WRITE,
	STEP_COMPARE,     /* what does the drive hold now? */
	STEP_WRITE_AGAIN, /* requests carry no checksum: a line may have come damaged */
	STEP_COMPARE_AGAIN,
	STEPS
};

static const struct conversation_step steps[STEPS]; /* below */

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
	vsmd_take_all_params(axis);
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

static enum db_step answer_probe(struct db_conversation *talk)
{
	const struct vsmd_reply *reply = talk->reply;

	vsmd_take_identity(axis_of(talk), reply->text, reply->text_length);
	return end_job(talk, DB_RESULT_OK);
}

static enum db_step answer_poll(struct db_conversation *talk)
{
	vsmd_follow_motion(axis_of(talk));
	return end_job(talk, DB_RESULT_OK);
}

static enum db_step answer_identity(struct db_conversation *talk)
{
	const struct vsmd_reply *reply = talk->reply;

	vsmd_take_identity(axis_of(talk), reply->text, reply->text_length);
	if (talk->job->kind == DB_JOB_IDENTIFY && !may_identify(axis_of(talk)))
		return end_job(talk, DB_RESULT_BUSY);
	return say_step(talk, steps, STEP_PARAMETERS);
}

static enum db_step answer_parameters(struct db_conversation *talk)
{
	take_params(axis_of(talk), talk->reply);
	return end_job(talk, DB_RESULT_OK);
}

/* While it moves what it holds is not asked. Of a line that it refused it is, too: it may have taken a part
 * of it, or refuse to be told what it holds already. */
static enum db_step answer_write(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	axis->refused = (axis->last.status & VSMD_ST_CMD_WRG) != 0;
	talk->device->refused_line = axis->refused;
	if (may_read_parameters(axis))
		return say_step(talk, steps,
		                talk->job->step == STEP_WRITE ? STEP_COMPARE : STEP_COMPARE_AGAIN);
	if (axis->refused) {
		/* Which of several settings it took is unknown: read all of them again. */
		axis->plate.doubtful |= talk->job->request->setting_count > 1;
		return end_job(talk, DB_RESULT_REFUSED);
	}
	vsmd_take_settings(axis, talk->job->request);
	axis->plate.doubtful = true;
	return end_job(talk, DB_RESULT_UNPROVEN);
}

static enum db_step refuse_parameters(struct db_conversation *talk)
{
	return end_job(talk, DB_RESULT_REFUSED);
}

/* The drive took what was written, or refused it; what it holds now it does not tell. */
static enum db_step leave_unproven(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	axis->plate.doubtful = true;
	if (talk->device->refused_line)
		return end_job(talk, DB_RESULT_REFUSED);
	vsmd_take_settings(axis, talk->job->request);
	return end_job(talk, DB_RESULT_UNPROVEN);
}

static enum db_step answer_compare(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	enum db_result compared;

	take_params(axis, talk->reply);
	compared = compare_settings(axis, talk->job->request);
	if (talk->device->refused_line && compared != DB_RESULT_OK)
		compared = DB_RESULT_REFUSED;
	else if (compared == DB_RESULT_REFUSED && talk->job->step == STEP_COMPARE)
		return say_step(talk, steps, STEP_WRITE_AGAIN);
	axis->refused = compared == DB_RESULT_REFUSED;
	return end_job(talk, compared);
}

static enum db_step answer_save(struct db_conversation *talk)
{
	const struct vsmd_reply *reply = talk->reply;
	struct vsmd_axis *axis = axis_of(talk);

	if (reply->code == VSMD_REPLY_PARAMS) {
		take_params(axis, reply);
		vsmd_memory_keep(&axis->memory, &axis->plate);
		return end_job(talk, DB_RESULT_OK);
	}
	return end_job(talk, reply->status.status & VSMD_ST_FLASH_ERR ? DB_RESULT_FAILED :
	                                                                DB_RESULT_REFUSED);
}

static const struct conversation_step steps[STEPS] = {
	[STEP_PROBE] = { say_identity, VSMD_REPLY_IDENTITY, .answered = answer_probe },
	[STEP_POLL] = { say_status, VSMD_REPLY_STATUS, .answered = answer_poll },
	[STEP_IDENTITY] = { say_identity, VSMD_REPLY_IDENTITY, .answered = answer_identity },
	[STEP_PARAMETERS] = { say_parameters, VSMD_REPLY_PARAMS, .answered = answer_parameters,
	                      .refused = refuse_parameters },
	[STEP_WRITE] = { say_settings, VSMD_REPLY_STATUS, .answered = answer_write },
	[STEP_COMPARE] = { say_parameters, VSMD_REPLY_PARAMS, .answered = answer_compare,
	                   .refused = leave_unproven, .lost = leave_unproven },
	[STEP_WRITE_AGAIN] = { say_settings, VSMD_REPLY_STATUS, .answered = answer_write },
	[STEP_COMPARE_AGAIN] = { say_parameters, VSMD_REPLY_PARAMS, .answered = answer_compare,
	                         .refused = leave_unproven, .lost = leave_unproven },
};

/* --- jobs -------------------------------------------------------------------------------------- */

static enum db_step look_at_drive(struct db_conversation *talk, enum vsmd_look what)
{
	(void)what; /* every answer has all of it */
	return say_status(talk);
}

static const struct vsmd_link serial_link = {
	.acknowledges = true,
	.shake_frequency_min = VSMD_SHAKE_FREQ_MIN,
	.first_option = 0,
	.say = say_line,
	.look = look_at_drive,
	.saved = answer_save,
};

static enum db_step begin_job(struct db_conversation *talk)
{
	const struct vsmd_axis *axis = axis_of(talk);

	if (vsmd_is_command(talk->job))
		return vsmd_begin_command(talk);
	switch (talk->job->kind) {
	case DB_JOB_PROBE:
		return say_step(talk, steps, STEP_PROBE);
	case DB_JOB_POLL:
		return say_step(talk, steps, STEP_POLL);
	case DB_JOB_SETTINGS:
		return say_step(talk, steps, STEP_WRITE);
	case DB_JOB_IDENTIFY:
		if (axis->heard && !may_identify(axis))
			return end_job(talk, DB_RESULT_BUSY);
		/* fall through */
	default: /* read_parameters */
		return say_step(talk, steps, STEP_IDENTITY);
	}
}

static enum db_step begin_conversation(struct db_conversation *talk)
{
	struct db_exchange *exchange = talk->exchange;
	enum db_step step = begin_job(talk);

	/* The line before may have lost its end: a bare one keeps this line from being glued to it. */
	if (step == DB_STEP_SEND && talk->job->out_of_step &&
	    exchange->request_length + 1 <= exchange->request_size) {
		memmove(exchange->request + 1, exchange->request, exchange->request_length);
		exchange->request[0] = '\n';
		exchange->request_length++;
	}
	return step;
}

/* What follows this reply; null: it is no answer to what was said last. */
static conversation_fn *follow_reply(const struct db_job *job, const struct vsmd_reply *reply)
{
	bool status = reply->code == VSMD_REPLY_STATUS;

	if (vsmd_is_command(job))
		return status || (reply->code == VSMD_REPLY_PARAMS && job->step == VSMD_STEP_SAVE) ?
		               vsmd_answer_command :
		               NULL;
	if (reply->code == steps[job->step].expects)
		return steps[job->step].answered;
	/* Instead of a text: the drive does not know the request, or does not answer it now. */
	return status && (reply->status.status & VSMD_ST_CMD_WRG) ? steps[job->step].refused : NULL;
}

static enum db_step answer_frame(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	const struct db_job *job = talk->job;
	conversation_fn *follow;
	struct vsmd_reply reply;
	enum db_step step;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_STEP_IGNORE;
	follow = follow_reply(job, &reply);
	if (!follow)
		return DB_STEP_IGNORE;
	// cppcheck-suppress autoVariables ; it is taken away below
	talk->reply = &reply;
	if (reply.code == VSMD_REPLY_STATUS) {
		vsmd_take_status(axis_of(talk), &reply.status, talk->now);
		if (job->kind == DB_JOB_COMMAND && !db_command_is_stop(job->request->command))
			vsmd_take_speed(axis_of(talk), reply.status.velocity);
	}
	step = follow(talk);
	talk->reply = NULL;
	return step;
}

static enum db_step lose_answer(struct db_conversation *talk)
{
	if (talk->job->kind == DB_JOB_SETTINGS)
		axis_of(talk)->plate.doubtful = true;
	return vsmd_is_command(talk->job) ? vsmd_lose_command(talk) : lose_step(talk, steps);
}

static enum db_result check_command(const struct db_bus_config *bus,
                                    const struct db_drive_config *drive, enum db_command command,
                                    const struct db_args *args)
{
	(void)bus;
	(void)drive;
	return vsmd_check_command(&serial_link, command, args);
}

static enum db_result check_param(const struct db_bus_config *bus, size_t param,
                                  union db_value value)
{
	(void)bus;
	if (param >= VSMD_SERIAL_PARAM_COUNT)
		return DB_RESULT_UNSUPPORTED;
	return vsmd_param_in_range((enum vsmd_param)param, value) ? DB_RESULT_OK :
	                                                            DB_RESULT_OUT_OF_RANGE;
}

/* --- state ------------------------------------------------------------------------------------- */

static void write_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	vsmd_axis_feedback(&device->axis, feedback);
}

static void forget_state(struct db_device *device)
{
	vsmd_axis_gone(&device->axis);
}

static const struct db_nameplate *get_nameplate(const struct db_device *device)
{
	return &device->axis.plate;
}

static void init_device(struct db_device *device, struct db_device *first,
                        const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first; /* one drive an address */
	vsmd_axis_init(&device->axis, &serial_link, bus, drive);
	device->id = bus->line == DB_LINE_RS232 ? VSMD_SERIAL_NO_ID : (int)drive->address;
}

/* --- the bus's side ---------------------------------------------------------------------------- */

static void cut_frame(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	*length = 0;
	if (vsmd_serial_cut(bytes, available, skip, length) != VSMD_CUT_FRAME)
		*length = 0;
}

static enum db_frame accept_frame(const struct db_bus_config *bus, const uint8_t *frame,
                                  size_t length, int *address)
{
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_FRAME_BAD;
	/* On RS232 there is one drive, and what id it gives differs. */
	*address = bus->line == DB_LINE_RS232 ? -1 : reply.id;
	return DB_FRAME_GOOD;
}

static uint32_t part_of(const struct db_bus_config *bus, const uint8_t *frame, size_t length)
{
	struct vsmd_reply reply;

	(void)bus;
	return vsmd_serial_decode_reply(frame, length, &reply) == VSMD_OK &&
	                       reply.code == VSMD_REPLY_STATUS ?
	               VSMD_REPLY_STATUS :
	               0;
}

static void describe_frame(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
                           size_t length, struct db_description *description)
{
	if (sent)
		vsmd_serial_describe_line(frame, length, bus->line == DB_LINE_RS485, description);
	else
		vsmd_serial_describe_reply(frame, length, description);
}

static db_time exchange_time(const struct db_bus_config *bus, size_t request, size_t answer)
{
	return db_serial_wire_time(bus, request + answer) + TYPICAL_LATENCY +
	       (db_time)bus->turnaround_us * DB_NS_PER_US;
}

static db_time poll_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, strlen("32 sts\n"), VSMD_SERIAL_STATUS_FRAME);
}

static db_time command_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, strlen("32 pos -2147483648 spd=192000.5\n"),
	                     VSMD_SERIAL_STATUS_FRAME);
}

static bool write_broadcast(enum db_command command, const struct db_bus_config *bus,
                            struct db_exchange *exchange)
{
	const struct db_args none = { 0 };
	struct vsmd_command said = vsmd_command_of(command, &none);

	if (bus->line != DB_LINE_RS485 ||
	    !(db_command_is_stop(command) || command == DB_CMD_ENABLE))
		return false;
	if (!write_line(VSMD_SERIAL_BROADCAST, &said, false, exchange))
		return false;
	exchange->answer_length = 0;
	return true;
}

/* The same line, for everybody. */
static bool begin_all(const struct db_device *device, const struct db_exchange *prepared,
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

static const unsigned speeds[] = {
	9600, 115200, 57600, 38400, 19200, 230400, 460800, 921600, 4800, 2400, 0,
};

const struct db_driver db_driver_vsmd_serial = {
	.name = "vsmd-serial",
	.title = "VSMD stepper on RS485 or RS232",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = VSMD_SERIAL_ID_MAX,
	.default_baud = 9600,
	.acknowledges = true,
	.vendor_layout = true,
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
	.check = check_command,
	.check_param = check_param,
	.input_ports = vsmd_input_ports,
	.poll_time = poll_time,
	.command_time = command_time,
	.device_size = sizeof(struct db_device),
	.init = init_device,
	.inquire = vsmd_serial_inquire,
	.recognise = vsmd_serial_recognise,
	.speeds = speeds,
	.address_effect = DB_TAKES_EFFECT_POWER_UP,
	.speed_effect = DB_TAKES_EFFECT_POWER_UP,
	.cut = cut_frame,
	.accept = accept_frame,
	.part = part_of,
	.describe = describe_frame,
	.begin = begin_conversation,
	.answer = answer_frame,
	.lost = lose_answer,
	.gone = forget_state,
	.feedback = write_feedback,
	.nameplate = get_nameplate,
	.broadcast = write_broadcast,
	.begin_all = begin_all,
	.begun_by_all = vsmd_begun_by_all,
};
