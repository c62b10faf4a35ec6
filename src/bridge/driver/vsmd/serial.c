/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD steppers on RS232 and RS485. Every command is answered by exactly one frame, whose status
 * word shows whether the drive accepted it (cmd_wrg); that answer is the confirmation.
 *
 * Source: VSMD custom protocol for RS232 & RS485, sections 2 and 3.
 */
#include "transport/serial.h"
#include "codec/vsmd_serial_frames.h"
#include "driver/list.h"
#include "driver/vsmd/commands.h"
#include "driver/vsmd/vsmd_private.h"

#include <math.h>
#include <string.h>

/* A number read back differs from the one written by at most this: absolute, and relative. */
#define PRINTED_STEP 0.0051
#define PRINTED_SHARE 1e-5

static const struct db_option options[] = { VSMD_DRIVE_OPTIONS };

struct db_device {
	struct vsmd_axis axis; /* first: see axis_of() */
	int id;
	/* The current parameter write, counting the settings of all its parts: */
	size_t line; /* the first of the line that was sent last ... */
	size_t sent; /* ... and the first that was not sent yet */
	bool apart;  /* one line per part: all in one line were refused */
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
	exchange->joins = exchange->proof = false;
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

static enum db_step send_line(struct db_conversation *talk, const struct vsmd_command *command,
                              bool repeatable)
{
	if (!write_line(talk->device->id, command, repeatable, talk->exchange))
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	if (command->verb == VSMD_SAV)
		talk->exchange->extra_time = talk->device->axis.save_time;
	return DB_STEP_SEND;
}

/* --- the steps -------------------------------------------------------------------------------- */

/* Steps of all jobs but the commands in commands.h. */
enum step {
	STEP_PROBE,
	STEP_POLL,
	STEP_IDENTITY,
	STEP_PARAMETERS,
	STEP_WRITE,
	STEP_COMPARE,     /* reads what the drive holds now */
	STEP_WRITE_AGAIN, /* requests carry no checksum: a line may have arrived damaged */
	STEP_COMPARE_AGAIN,
	STEPS
};

static const struct conversation_step steps[STEPS]; /* below */

/* In every cycle: the compiler knows the verb. */
static enum db_step send_status(struct db_conversation *talk)
{
	return send_line(talk, &(struct vsmd_command){ .verb = VSMD_STS }, true);
}

static enum db_step send_read(struct db_conversation *talk)
{
	static const enum vsmd_verb verbs[STEPS] = {
		[STEP_PROBE] = VSMD_DEV,
		[STEP_IDENTITY] = VSMD_DEV,
		[STEP_PARAMETERS] = VSMD_CFG_READ,
		[STEP_COMPARE] = VSMD_CFG_READ,
		[STEP_COMPARE_AGAIN] = VSMD_CFG_READ,
	};
	unsigned step = talk->job->step;
	enum db_step sent = send_line(talk, &(struct vsmd_command){ .verb = verbs[step] }, true);

	if (step == STEP_COMPARE || step == STEP_COMPARE_AGAIN)
		talk->exchange->proof = true;
	return sent;
}

/* True if its result is not known yet. */
static bool is_open(const struct db_write_part *part)
{
	return part->result == DB_RESULT_PENDING;
}

/*
 * The next line of settings: all that were not sent yet. When a drive refused that, it may be
 * because of one of them, and each part gets its own line; while a drive moves each setting gets
 * its own, so that a stop never waits for a long line.
 */
static enum db_step send_settings(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct vsmd_setting settings[DB_SETTINGS_MAX];
	const struct db_write_part *begun = NULL;
	enum db_step step;
	size_t count = 0;
	size_t place = 0;

	device->line = device->sent;
	for (const struct db_write_part *part = talk->job->parts; part; part = part->next) {
		for (size_t i = 0; i < part->request->setting_count; i++, place++) {
			const struct db_setting *setting = &part->request->settings[i];

			if (place < device->sent)
				continue;
			if (count > 0 && is_open(part) &&
			    (talk->brief || (device->apart && part != begun)))
				goto full;
			device->sent = place + 1;
			if (!is_open(part))
				continue;
			begun = part;
			settings[count].param = (enum vsmd_param)setting->param;
			settings[count++].value = setting->value;
		}
	}
full:
	step = send_line(talk,
	                 &(struct vsmd_command){ .verb = VSMD_CFG_WRITE,
	                                         .settings = settings,
	                                         .setting_count = count },
	                 true);
	talk->exchange->joins = talk->job->step == STEP_WRITE;
	return step;
}

/* True if a part of the write was not sent yet. */
static bool has_more(const struct db_conversation *talk)
{
	size_t end = 0;

	for (const struct db_write_part *part = talk->job->parts; part; part = part->next) {
		end += part->request->setting_count;
		if (is_open(part) && end > talk->device->sent)
			return true;
	}
	return false;
}

/* The drive answered the last line. False: it refused a line of several parts. */
static bool note_line(struct db_conversation *talk, bool refused)
{
	struct db_device *device = talk->device;
	struct db_write_part *first = NULL;
	size_t begin = 0;

	for (struct db_write_part *part = talk->job->parts; part; part = part->next) {
		size_t end = begin + part->request->setting_count;

		if (is_open(part) && end > device->line && begin < device->sent) {
			if (refused && first)
				return false;
			first = first ? first : part;
			part->taken = !refused && !part->refused && end <= device->sent;
		}
		begin = end;
	}
	if (refused && first)
		first->refused = true;
	return true;
}

/* Ends with what the drive accepted or refused; it does not report the values that it holds now. */
static enum db_step end_unproven(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	axis->refused = false;
	for (struct db_write_part *part = talk->job->parts; part; part = part->next) {
		if (is_open(part) && !part->refused) {
			part->result = DB_RESULT_UNPROVEN;
			vsmd_take_settings(axis, part->request);
			axis->plate.doubtful = true;
		} else if (is_open(part)) {
			part->result = DB_RESULT_REFUSED;
			axis->refused = true;
			/* It is not known which of several settings it accepted: read all of them
			 * again. */
			axis->plate.doubtful |= part->request->setting_count > 1;
		}
	}
	return end_job(talk, talk->job->parts->result);
}

/* The text of all parameters cannot be interrupted, and a stop would wait for it. */
static bool may_read_parameters(const struct vsmd_axis *axis)
{
	return axis->has_status && (axis->last.status & VSMD_ST_STP);
}

/* A moving drive is only asked if nothing is known of it yet: as after a restart of this
 * program. */
static bool may_identify(const struct vsmd_axis *axis)
{
	return may_read_parameters(axis) || axis->plate.valid[0] == 0;
}

static void take_params(struct vsmd_axis *axis, const struct vsmd_reply *reply, db_time now)
{
	struct vsmd_setting setting;
	size_t cursor = 0;
	int found;

	axis->plate.valid[0] = 0;
	while ((found = vsmd_serial_next_param(reply->text, reply->text_length, &cursor,
	                                       &setting)) != 0) {
		if (found != 1)
			continue;
		axis->plate.values[setting.param] = setting.value;
		axis->plate.valid[0] |= UINT64_C(1) << setting.param;
	}
	db_nameplate_note_told(&axis->plate, axis->plate.valid, now);
	vsmd_take_all_params(axis);
}

/* Drives print numbers with as few as two decimals. */
static bool is_written(size_t param, union db_value held, union db_value written)
{
	if (vsmd_params[param].type != DB_F32)
		return held.u == written.u;
	return fabs((double)held.f - (double)written.f) <=
	       PRINTED_STEP + PRINTED_SHARE * fabs((double)written.f);
}

/* Compares what the drive holds with what was written. */
static enum db_result compare_settings(const struct vsmd_axis *axis,
                                       const struct db_request *request)
{
	enum db_result result = DB_RESULT_OK;

	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];

		if (!(axis->plate.valid[0] >> setting->param & 1))
			result = DB_RESULT_UNPROVEN;
		else if (!is_written(setting->param, axis->plate.values[setting->param],
		                     setting->value))
			return DB_RESULT_REFUSED;
	}
	return result;
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
	if (talk->job->step == STEP_PROBE)
		return end_job(talk, DB_RESULT_OK);
	if (talk->job->kind == DB_JOB_IDENTIFY && !may_identify(axis_of(talk)))
		return end_job(talk, DB_RESULT_BUSY);
	return send_step(talk, steps, STEP_PARAMETERS);
}

static enum db_step answer_parameters(struct db_conversation *talk)
{
	take_params(axis_of(talk), talk->reply, talk->now);
	return end_job(talk, DB_RESULT_OK);
}

/*
 * While a drive moves the values are not read. After a refused line they are: the drive may have
 * accepted a part of it, or refuse values that it holds already.
 */
static enum db_step answer_write(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct vsmd_axis *axis = axis_of(talk);
	bool refused = (axis->last.status & VSMD_ST_CMD_WRG) != 0;

	/* The refusal may be for this line, or for an earlier unanswered one. */
	if (refused && !axis->refuses) {
		device->sent = device->line;
		return send_step(talk, steps, talk->job->step);
	}
	if (!note_line(talk, refused)) {
		device->apart = true;
		device->sent = device->line;
	}
	if (has_more(talk))
		return send_step(talk, steps, talk->job->step);
	if (may_read_parameters(axis) && !talk->brief)
		return send_step(talk, steps,
		                 talk->job->step == STEP_WRITE ? STEP_COMPARE : STEP_COMPARE_AGAIN);
	return end_unproven(talk);
}

/* A later line was lost, or a repeat, or a stop was sent in between: what was acknowledged before
 * is known. */
static enum db_step lose_write(struct db_conversation *talk)
{
	for (struct db_write_part *part = talk->job->parts; part; part = part->next) {
		if (is_open(part) && part->refused)
			part->result = DB_RESULT_REFUSED;
		else if (is_open(part) && part->taken && talk->job->step == STEP_WRITE) {
			part->result = DB_RESULT_UNPROVEN;
			vsmd_take_settings(axis_of(talk), part->request);
		}
	}
	return end_job(talk, DB_RESULT_TIMEOUT);
}

static enum db_step answer_compare(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	bool again = false;

	take_params(axis, talk->reply, talk->now);
	axis->refused = false;
	for (struct db_write_part *part = talk->job->parts; part; part = part->next) {
		enum db_result compared = compare_settings(axis, part->request);

		if (!is_open(part))
			continue;
		if (part->refused && compared != DB_RESULT_OK)
			compared = DB_RESULT_REFUSED;
		else if (compared == DB_RESULT_REFUSED && talk->job->step == STEP_COMPARE) {
			part->taken = false;
			again = true;
			continue;
		}
		part->result = compared;
		axis->refused |= compared == DB_RESULT_REFUSED;
	}
	if (!again)
		return end_job(talk, talk->job->parts ? talk->job->parts->result : DB_RESULT_OK);
	talk->device->sent = 0;
	return send_step(talk, steps, STEP_WRITE_AGAIN);
}

static enum db_step answer_save(struct db_conversation *talk)
{
	const struct vsmd_reply *reply = talk->reply;
	struct vsmd_axis *axis = axis_of(talk);

	if (reply->code == VSMD_REPLY_PARAMS) {
		take_params(axis, reply, talk->now);
		vsmd_memory_keep(&axis->memory, &axis->plate);
		return end_job(talk, DB_RESULT_OK);
	}
	return end_job(talk, reply->status.status & VSMD_ST_FLASH_ERR ? DB_RESULT_FAILED :
	                                                                DB_RESULT_REFUSED);
}

static const struct conversation_step steps[STEPS] = {
	[STEP_PROBE] = { send_read, VSMD_REPLY_IDENTITY, .answered = answer_identity },
	[STEP_POLL] = { send_status, VSMD_REPLY_STATUS, .answered = answer_poll },
	[STEP_IDENTITY] = { send_read, VSMD_REPLY_IDENTITY, .answered = answer_identity },
	[STEP_PARAMETERS] = { send_read, VSMD_REPLY_PARAMS, .answered = answer_parameters,
	                      .refused = end_refused },
	[STEP_WRITE] = { send_settings, VSMD_REPLY_STATUS, .answered = answer_write,
	                 .lost = lose_write },
	[STEP_COMPARE] = { send_read, VSMD_REPLY_PARAMS, .answered = answer_compare,
	                   .refused = end_unproven, .lost = end_unproven },
	[STEP_WRITE_AGAIN] = { send_settings, VSMD_REPLY_STATUS, .answered = answer_write,
	                       .lost = lose_write },
	[STEP_COMPARE_AGAIN] = { send_read, VSMD_REPLY_PARAMS, .answered = answer_compare,
	                         .refused = end_unproven, .lost = end_unproven },
};

/* --- jobs ------------------------------------------------------------------------------------- */

static enum db_step read_drive(struct db_conversation *talk, enum vsmd_read what)
{
	(void)what; /* every answer contains all values */
	return send_status(talk);
}

static const struct vsmd_link serial_link = {
	.acknowledges = true,
	.shake_frequency_min = VSMD_SHAKE_FREQ_MIN,
	.send = send_line,
	.read = read_drive,
	.saved = answer_save,
};

static enum db_step begin_job(struct db_conversation *talk)
{
	const struct vsmd_axis *axis = axis_of(talk);

	if (vsmd_is_command(talk->job))
		return vsmd_begin_command(talk);
	switch (talk->job->kind) {
	case DB_JOB_PROBE:
		return send_step(talk, steps, STEP_PROBE);
	case DB_JOB_POLL:
		return send_step(talk, steps, STEP_POLL);
	case DB_JOB_SETTINGS:
		talk->device->sent = 0;
		talk->device->apart = false;
		return send_step(talk, steps, STEP_WRITE);
	case DB_JOB_REFRESH:
		return may_read_parameters(axis) ? send_step(talk, steps, STEP_PARAMETERS) :
		                                   end_job(talk, DB_RESULT_BUSY);
	case DB_JOB_IDENTIFY:
		if (axis->has_status && !may_identify(axis))
			return end_job(talk, DB_RESULT_BUSY);
		return send_step(talk, steps, STEP_IDENTITY);
	default: /* read_parameters */
		if (talk->brief)
			return end_job(talk, DB_RESULT_LINE_MOVES);
		return send_step(talk, steps, STEP_IDENTITY);
	}
}

static enum db_step begin_conversation(struct db_conversation *talk)
{
	struct db_exchange *exchange = talk->exchange;
	enum db_step step = begin_job(talk);

	/* The previous line may have lost its end: a bare line end separates this line from it. */
	if (step == DB_STEP_SEND && talk->job->out_of_step &&
	    exchange->request_length + 1 <= exchange->request_size) {
		memmove(exchange->request + 1, exchange->request, exchange->request_length);
		exchange->request[0] = '\n';
		exchange->request_length++;
	}
	return step;
}

static enum db_step answer_frame(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	const struct db_job *job = talk->job;
	conversation_fn *follow = NULL;
	struct vsmd_reply reply;
	enum db_step step;
	bool status;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_STEP_IGNORE;
	status = reply.code == VSMD_REPLY_STATUS;
	if (vsmd_is_command(job)) {
		if (status || (reply.code == VSMD_REPLY_PARAMS && job->step == VSMD_STEP_SAVE))
			follow = vsmd_command_steps[job->step].answered;
	} else if (reply.code == steps[job->step].expects) {
		follow = steps[job->step].answered;
	} else if (status && (reply.status.status & VSMD_ST_CMD_WRG)) {
		/* Instead of a text: the drive does not know the request, or does not answer it
		 * now. */
		follow = steps[job->step].refused;
	}
	/* Else it is no answer to what was sent last. */
	if (!follow)
		return DB_STEP_IGNORE;
	// cppcheck-suppress autoVariables ; it is taken away below
	talk->reply = &reply;
	if (status) {
		vsmd_take_status(axis_of(talk), &reply.status, talk->now);
		if (job->kind == DB_JOB_COMMAND && !db_command_is_stop(job->request->command))
			vsmd_take_speed(axis_of(talk), axis_of(talk)->last.velocity);
	}
	step = follow(talk);
	talk->reply = NULL;
	return step;
}

static enum db_step lose_answer(struct db_conversation *talk)
{
	if (talk->job->kind == DB_JOB_SETTINGS)
		axis_of(talk)->plate.doubtful = true;
	if (vsmd_is_command(talk->job))
		return lose_step(talk, vsmd_command_steps);
	/* Some drives do not answer unknown requests. */
	axis_of(talk)->unanswered = true;
	return lose_step(talk, steps);
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

/* --- state ------------------------------------------------------------------------------------ */

static void init_device(struct db_device *device, struct db_device *first,
                        const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first; /* one drive per address */
	vsmd_axis_init(&device->axis, &serial_link, bus, drive);
	device->id = bus->line == DB_LINE_RS232 ? VSMD_SERIAL_NO_ID : (int)drive->address;
}

/* --- the bus's side --------------------------------------------------------------------------- */

static bool write_broadcast(enum db_command command, const struct db_bus_config *bus,
                            struct db_exchange *exchange)
{
	const struct db_args none = { 0 };
	struct vsmd_command sent = vsmd_command_of(command, &none);

	if (bus->line != DB_LINE_RS485 ||
	    !(db_command_is_stop(command) || command == DB_CMD_ENABLE))
		return false;
	if (!write_line(VSMD_SERIAL_BROADCAST, &sent, false, exchange))
		return false;
	exchange->answer_length = 0;
	return true;
}

/* The same line, to all drives. */
static bool begin_all(const struct db_device *device, const struct db_exchange *prepared,
                      struct db_exchange *all)
{
	const uint8_t *end = prepared->request + prepared->request_length;
	const uint8_t *blank = memchr(prepared->request, ' ', prepared->request_length);

	if (device->id == VSMD_SERIAL_NO_ID || !blank ||
	    (size_t)(end - blank) + 1 > all->request_size)
		return false;
	/* Without what precedes the blank: the address, and a line end that may separate it. */
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
	.option_count = sizeof(options) / sizeof(options[0]),
	.drive_options_size = sizeof(struct vsmd_drive_options),
	.commands = VSMD_COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_VELOCITY,
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
	.joins_settings = true,
	.holds = is_written,
	/* Each text may take a second at 9600 baud. */
	.refresh_pause = 60 * DB_NS_PER_S,
	.poll_time = vsmd_serial_poll_time,
	.command_time = vsmd_serial_command_time,
	.device_size = sizeof(struct db_device),
	.init = init_device,
	.inquire = vsmd_serial_inquire,
	.recognise = vsmd_serial_recognise,
	.speeds = speeds,
	.address_effect = DB_TAKES_EFFECT_POWER_UP,
	.speed_effect = DB_TAKES_EFFECT_POWER_UP,
	.cut = vsmd_serial_cut_frame,
	.usual_answer = VSMD_SERIAL_STATUS_FRAME,
	.accept = vsmd_serial_accept,
	.part = vsmd_serial_part,
	.describe = vsmd_serial_describe_any,
	.begin = begin_conversation,
	.answer = answer_frame,
	.lost = lose_answer,
	.gone = vsmd_axis_gone,
	.feedback = vsmd_write_feedback,
	.nameplate = vsmd_get_nameplate,
	.broadcast = write_broadcast,
	.mishears = vsmd_serial_mishears,
	.begin_all = begin_all,
	.begun_by_all = vsmd_begun_by_all,
};
