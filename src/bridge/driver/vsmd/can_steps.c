/* SPDX-License-Identifier: Apache-2.0 */
/* Writing and reading parameters, and the jobs of a drive. */
#include "driver/vsmd/vsmd_private.h"

#include "driver/vsmd/can_frames.h"
#include "driver/vsmd/commands.h"

#include <string.h>

/* A register that is not answered this number of times, while the read after it is answered, does
 * not exist in this model. */
#define REGISTER_TRIES 2

/* Number of writes to a register that holds another value after a write. */
#define WRITES_MAX 2

/* Number of registers read at once. */
#define RUN_MAX 8

/* A drive that answers probes, but not this number of longer reads, is asked for fewer registers at
 * once. */
#define LONG_READS 2

/* Steps of all jobs but the commands in commands.h. */
enum step {
	STEP_PROBE,
	STEP_POLL,
	STEP_REPORT,
	STEP_IDENTITY,
	STEP_REGISTERS,
	STEP_FETCH, /* read before the write: a register that holds several parameters */
	STEP_FETCH_AGAIN,
	STEP_WRITE, /* and its read after that */
	STEP_CONFIRM_AGAIN,
	STEP_REFRESH, /* one register with parameters, each in its turn */
	STEP_EXPLAIN, /* it holds another value: was the write refused? */
	STEPS
};

static const struct conversation_step steps[STEPS]; /* below */

/* --- writing parameters ----------------------------------------------------------------------- */

static unsigned reg_of(const struct db_request *request, size_t i)
{
	return vsmd_can_fields[request->settings[i].param].reg;
}

/* Reads the current register; to explain a refused write, the status. */
static enum db_step read_register(struct db_conversation *talk)
{
	const struct db_device *device = talk->device;
	unsigned reg = talk->job->step == STEP_REFRESH ?
	                       device->refreshed :
	                       reg_of(talk->job->request, device->setting);

	if (talk->job->step == STEP_EXPLAIN)
		return vsmd_can_read(talk, VSMD_READ_STATUS);
	vsmd_can_start_burst(talk->exchange, true);
	return vsmd_can_add_guarded(talk, VSMD_CAN_READ_DATA, reg, 1);
}

/* Writes the register's new content, and reads it to verify. */
static enum db_step write_register(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;
	struct db_device *device = talk->device;
	unsigned reg = reg_of(request, device->setting);
	uint32_t raw = vsmd_can_reg_packed(reg) ? device->answer.values[0] : 0;
	struct db_can_frame frame;

	/* Every setting of this register goes into its raw value. */
	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];

		if (reg_of(request, i) == reg && vsmd_can_insert((enum vsmd_param)setting->param,
		                                                 setting->value, &raw) != VSMD_OK)
			return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	}
	if (vsmd_can_encode_write(&device->style, device->drive, reg, &raw, 1, &frame) != VSMD_OK)
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	device->written = raw;
	device->writes++;
	vsmd_can_start_burst(talk->exchange, true);
	if (!vsmd_can_add_frame(talk->exchange, &frame))
		return end_job(talk, DB_RESULT_FAILED);
	return vsmd_can_add_guarded(talk, VSMD_CAN_READ_DATA, reg, 1);
}

/* A register that holds several parameters is read first, so that the others stay as they are. */
static enum db_step write_next(struct db_conversation *talk, size_t from)
{
	const struct db_request *request = talk->job->request;
	struct db_device *device = talk->device;
	size_t earlier;

	/* The first setting from there on whose register was not written for an earlier one. */
	for (; from < request->setting_count; from++) {
		earlier = 0;
		while (earlier < from && reg_of(request, earlier) != reg_of(request, from))
			earlier++;
		if (earlier == from)
			break;
	}
	device->setting = from;
	device->writes = 0;
	if (device->setting == request->setting_count) {
		vsmd_take_settings(&device->axis, request);
		return end_job(talk, DB_RESULT_OK);
	}
	return send_step(talk, steps,
	                 vsmd_can_reg_packed(reg_of(request, device->setting)) ? STEP_FETCH :
	                                                                         STEP_WRITE);
}

/* Takes a register's content for the parameters in it; returns their bits. */
static uint64_t take_register(struct db_device *device, unsigned reg, uint32_t raw, db_time now)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	size_t count = vsmd_can_params_of(reg, params);
	uint64_t taken = 0;

	for (size_t i = 0; i < count; i++) {
		if (vsmd_can_extract(params[i], raw, &device->axis.plate.values[params[i]]) ==
		    VSMD_OK)
			taken |= UINT64_C(1) << params[i];
	}
	db_nameplate_note_told(&device->axis.plate, &taken, now);
	return taken;
}

static void note_register(struct db_device *device, unsigned reg, db_time now)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	size_t count = vsmd_can_params_of(reg, params);
	uint64_t read = 0;

	for (size_t i = 0; i < count; i++)
		read |= UINT64_C(1) << params[i];
	db_nameplate_note_told(&device->axis.plate, &read, now);
}

/* True if a register holds another value than before, as far as that is known. */
static bool is_altered(const struct db_device *device, unsigned reg, uint32_t raw)
{
	const struct db_nameplate *plate = &device->axis.plate;
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	size_t count = vsmd_can_params_of(reg, params);
	union db_value value;

	for (size_t i = 0; i < count; i++) {
		if (vsmd_can_extract(params[i], raw, &value) == VSMD_OK &&
		    (plate->valid[0] >> params[i] & 1) && plate->values[params[i]].u != value.u)
			return true;
	}
	return false;
}

/* The register was read, before the write or after it. */
static enum db_step answer_write(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct vsmd_axis *axis = &device->axis;
	uint32_t held = device->answer.values[0];
	unsigned step = talk->job->step;

	if (!device->whole) {
		if (step == STEP_FETCH)
			return send_step(talk, steps, STEP_FETCH_AGAIN);
		if (step == STEP_WRITE)
			return send_step(talk, steps, STEP_CONFIRM_AGAIN);
		/* It was read twice: this was no lost frame. */
		axis->plate.doubtful = true;
		return end_job(talk, DB_RESULT_UNSUPPORTED);
	}
	if (step == STEP_FETCH || step == STEP_FETCH_AGAIN)
		return send_step(talk, steps, STEP_WRITE);
	if (held == device->written) {
		/* All of them are shown at once, when the last one has arrived. */
		note_register(device, device->answer.id.reg, talk->now);
		return write_next(talk, device->setting + 1);
	}
	/* A write is not acknowledged: its frame may have been lost. */
	if (device->writes < WRITES_MAX)
		return send_step(talk, steps, STEP_WRITE);
	/* What it holds instead is shown. */
	device->altered = is_altered(device, device->answer.id.reg, held);
	axis->plate.valid[0] |= take_register(device, device->answer.id.reg, held, talk->now);
	axis->plate.generation++;
	vsmd_memory_follow(&axis->memory, &axis->plate, false);
	axis->plate.doubtful |= talk->job->request->setting_count > 1;
	return send_step(talk, steps, STEP_EXPLAIN);
}

/* A value that the drive changed was refused, too; a write that it ignored twice has failed. */
static enum db_step answer_explain(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	vsmd_can_take_read(device, talk->now);
	device->axis.refused = device->altered || (device->axis.last.status & VSMD_ST_CMD_WRG);
	return end_job(talk, device->axis.refused ? DB_RESULT_REFUSED : DB_RESULT_FAILED);
}

/* --- identity and parameters ------------------------------------------------------------------ */

static struct vsmd_can_search *search_of(const struct db_conversation *talk)
{
	return &talk->device->searches[talk->job->kind == DB_JOB_IDENTIFY];
}

/*
 * Reporting is set again each time a drive is identified: it may have restarted, or another master
 * may have changed it. A read of the identity in parts leaves no room for that; then it is a step
 * of its own.
 */
static enum db_step send_identity(struct db_conversation *talk)
{
	const struct db_device *device = talk->device;
	const struct vsmd_can_command report = {
		.code = VSMD_CAN_AUTO_RES_STS,
		.report = device->report,
		.has_interval = device->report_interval > 0,
		.interval = (uint16_t)(device->report_interval / DB_NS_PER_MS),
	};
	bool alone = talk->job->step == STEP_REPORT;

	vsmd_can_start_burst(talk->exchange, true);
	if ((alone || !device->reads_short) &&
	    !vsmd_can_add_command(&device->style, device->drive, &report, talk->exchange))
		return end_job(talk, DB_RESULT_FAILED);
	if (alone)
		return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, vsmd_can_guard_of(device), 1);
	if (vsmd_can_lacks_identity(device))
		return vsmd_can_add_guarded(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY,
		                            VSMD_CAN_IDENTITY_REGS);
	return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY,
	                         VSMD_CAN_IDENTITY_REGS);
}

static bool is_parameter(const struct db_device *device, unsigned reg)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];

	return vsmd_can_params_of(reg, params) > 0 && !(device->lacks >> reg & 1) &&
	       vsmd_can_reg_reachable(reg, device->style.extended);
}

/* The next range of registers with parameters, from search->first on. False at the end. */
static bool next_run(const struct db_device *device, struct vsmd_can_search *search)
{
	unsigned run;

	while (search->first <= VSMD_CAN_DATA_LAST && !is_parameter(device, search->first))
		search->first++;
	run = search->first < search->suspect_end ? search->run :
	      device->reads_short                 ? VSMD_CAN_FRAME_REGS :
	                                            RUN_MAX;
	search->count = 0;
	while (search->count < run && search->first + search->count <= VSMD_CAN_DATA_LAST &&
	       is_parameter(device, search->first + search->count))
		search->count++;
	return search->count > 0;
}

static enum db_step send_registers(struct db_conversation *talk)
{
	struct vsmd_can_search *search = search_of(talk);
	struct vsmd_axis *axis = axis_of(talk);

	if (next_run(talk->device, search)) {
		vsmd_can_start_burst(talk->exchange, true);
		return vsmd_can_add_guarded(talk, VSMD_CAN_READ_DATA, search->first, search->count);
	}
	axis->plate.valid[0] = search->found;
	vsmd_take_all_params(axis);
	return end_job(talk, DB_RESULT_OK);
}

static enum db_step answer_identity(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	bool reported = talk->job->step == STEP_REPORT;

	if (reported && !vsmd_can_lacks_identity(device))
		return send_step(talk, steps, STEP_IDENTITY);
	if (!reported && device->whole) {
		uint32_t generation;
		char text[VSMD_CAN_IDENTITY_MAX + 1];
		int length;

		device->probe = VSMD_CAN_PROBE_IDENTITY;
		device->reads_long |= !device->reads_short;
		generation = device->axis.plate.generation;
		length = vsmd_can_get_identity(device->answer.values, text);
		if (length > 0)
			vsmd_take_identity(&device->axis, text, (size_t)length);
		/* A different model. */
		if (device->axis.plate.generation != generation)
			device->lacks = 0;
	}
	*search_of(talk) = (struct vsmd_can_search){ .first = VSMD_CAN_DATA_FIRST };
	return send_step(talk, steps, STEP_REGISTERS);
}

static enum db_step answer_registers(struct db_conversation *talk)
{
	struct vsmd_can_search *search = search_of(talk);
	struct db_device *device = talk->device;

	if (device->whole) {
		for (unsigned i = 0; i < search->count; i++)
			search->found |= take_register(device, search->first + i,
			                               device->answer.values[i], talk->now);
		/* What is known is shown at once. */
		device->axis.plate.valid[0] |= search->found;
		device->axis.plate.generation++;
		search->first += search->count;
		search->tries = 0;
	} else if (search->count > 1) {
		/* The range is read again in halves. */
		search->suspect_end = search->first + search->count;
		search->run = search->count / 2;
	} else if (++search->tries >= REGISTER_TRIES) {
		device->lacks |= UINT64_C(1) << search->first;
		search->tries = 0;
	}
	return send_step(talk, steps, STEP_REGISTERS);
}

/* --- in turn ---------------------------------------------------------------------------------- */

static enum db_step answer_refresh(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct vsmd_axis *axis = &device->axis;
	uint32_t held = device->answer.values[0];

	if (!device->whole)
		return end_job(talk, DB_RESULT_UNSUPPORTED);
	if (is_altered(device, device->refreshed, held)) {
		(void)take_register(device, device->refreshed, held, talk->now);
		axis->plate.generation++;
		vsmd_memory_follow(&axis->memory, &axis->plate, false);
	} else {
		note_register(device, device->refreshed, talk->now);
	}
	return end_job(talk, DB_RESULT_OK);
}

/* --- the table -------------------------------------------------------------------------------- */

static enum db_step answer_probe(struct db_conversation *talk)
{
	talk->device->probe_known = true;
	return end_job(talk, DB_RESULT_OK);
}

static enum db_step send_probe(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	if (!device->probe_known && device->probe_sent)
		device->probe = (enum vsmd_can_probe)((device->probe + 1u) % VSMD_CAN_PROBES);
	device->probe_sent = true;
	vsmd_can_start_burst(talk->exchange, true);
	switch (device->probe) {
	case VSMD_CAN_PROBE_SPEED:
		return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, 1);
	case VSMD_CAN_PROBE_DATA:
		return vsmd_can_add_read(talk, VSMD_CAN_READ_DATA, VSMD_CAN_DATA_FIRST, 1);
	case VSMD_CAN_PROBE_IDENTITY:
	default:
		return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY, 1);
	}
}

static void note_long_read_lost(struct db_device *device)
{
	if (!device->reads_long && ++device->lost_reads >= LONG_READS)
		device->reads_short = true;
}

static enum db_step send_poll(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	if (device->poll_open)
		note_long_read_lost(device);
	device->poll_open = !vsmd_can_lacks_speed(device);
	vsmd_can_start_burst(talk->exchange, true);
	return vsmd_can_add_status(talk, !vsmd_can_lacks_speed(device));
}

static enum db_step answer_poll(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	device->poll_open = false;
	device->reads_long |= !device->reads_short && !vsmd_can_lacks_speed(device);
	vsmd_can_take_poll(device, talk->now);
	return end_job(talk, DB_RESULT_OK);
}

static const struct conversation_step steps[STEPS] = {
	[STEP_PROBE] = { .send = send_probe, .answered = answer_probe },
	[STEP_POLL] = { .send = send_poll, .answered = answer_poll },
	[STEP_REPORT] = { .send = send_identity, .answered = answer_identity },
	[STEP_IDENTITY] = { .send = send_identity, .answered = answer_identity },
	[STEP_REGISTERS] = { .send = send_registers, .answered = answer_registers },
	[STEP_FETCH] = { .send = read_register, .answered = answer_write },
	[STEP_FETCH_AGAIN] = { .send = read_register, .answered = answer_write },
	[STEP_WRITE] = { .send = write_register, .answered = answer_write },
	[STEP_CONFIRM_AGAIN] = { .send = read_register, .answered = answer_write },
	[STEP_REFRESH] = { .send = read_register, .answered = answer_refresh },
	[STEP_EXPLAIN] = { .send = read_register, .answered = answer_explain, .lost = end_failed },
};

static enum db_step answer_save(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	if (axis->last.status & VSMD_ST_FLASH_ERR)
		return end_job(talk, DB_RESULT_FAILED);
	axis->refused = (axis->last.status & VSMD_ST_CMD_WRG) != 0;
	if (!axis->refused)
		vsmd_memory_keep(&axis->memory, &axis->plate);
	/* No status shows that something was written. */
	return end_job(talk, axis->refused ? DB_RESULT_REFUSED : DB_RESULT_UNPROVEN);
}

const struct vsmd_link vsmd_can_link = {
	.acknowledges = false,
	.shake_frequency_min = VSMD_SHAKE_FREQ_MIN_CAN,
	.send = vsmd_can_send_command,
	.read = vsmd_can_read,
	.saved = answer_save,
};

/* --- jobs ------------------------------------------------------------------------------------- */

enum db_step vsmd_can_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	if (vsmd_is_command(talk->job))
		return vsmd_begin_command(talk);
	switch (talk->job->kind) {
	case DB_JOB_PROBE:
		return send_step(talk, steps, STEP_PROBE);
	case DB_JOB_POLL:
		return send_step(talk, steps, STEP_POLL);
	case DB_JOB_SETTINGS:
		return write_next(talk, 0);
	case DB_JOB_REFRESH:
		/* The next register whose parameters are known. */
		for (unsigned n = VSMD_CAN_DATA_FIRST; n <= VSMD_CAN_DATA_LAST; n++) {
			if (++device->refreshed > VSMD_CAN_DATA_LAST)
				device->refreshed = VSMD_CAN_DATA_FIRST;
			if (is_parameter(device, device->refreshed))
				return send_step(talk, steps, STEP_REFRESH);
		}
		return end_job(talk, DB_RESULT_UNSUPPORTED);
	case DB_JOB_COMMAND: /* read_parameters */
	default:
		device->lacks = 0;
		/* fall through */
	case DB_JOB_IDENTIFY:
		return send_step(talk, steps, device->reads_short ? STEP_REPORT : STEP_IDENTITY);
	}
}

enum db_step vsmd_can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct db_device *device = talk->device;
	struct vsmd_can_message message;
	struct db_can_frame frame;
	enum db_step step;

	if (length != sizeof(frame))
		return DB_STEP_IGNORE;
	memcpy(&frame, bytes, sizeof(frame));
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK ||
	    !vsmd_can_expect_answer(device, talk->exchange))
		return DB_STEP_IGNORE;
	/* A late answer to an earlier probe, while it is not known which one is answered. */
	if (talk->job->kind == DB_JOB_PROBE && !device->probe_known &&
	    device->probe != VSMD_CAN_PROBE_IDENTITY && message.id.source == device->drive &&
	    message.id.control == VSMD_CAN_STATUS_REPLY && message.id.reg == VSMD_CAN_IDENTITY &&
	    message.count == 1) {
		device->probe = VSMD_CAN_PROBE_IDENTITY;
		return answer_probe(talk);
	}
	step = vsmd_can_collect_answer(device, &message);
	if (step != DB_STEP_DONE)
		return step;
	if (!vsmd_is_command(talk->job))
		return steps[talk->job->step].answered(talk);
	device->reads_long |= !device->reads_short && device->answer.count == VSMD_CAN_STATUS_REGS;
	vsmd_can_take_read(device, talk->now);
	return vsmd_command_steps[talk->job->step].answered(talk);
}

enum db_step vsmd_can_lose_answer(struct db_conversation *talk)
{
	bool command = vsmd_is_command(talk->job);

	if (talk->job->kind == DB_JOB_SETTINGS)
		axis_of(talk)->plate.doubtful = true;
	/* Where cyclic reads are of two registers, those of commands are of three. A drive that is
	 * gone answers no stops, however short their reads are. */
	if (vsmd_can_lacks_speed(talk->device) &&
	    (command ? axis_of(talk)->has_status : talk->job->step == STEP_IDENTITY))
		note_long_read_lost(talk->device);
	if (command)
		return lose_step(talk, vsmd_command_steps);
	axis_of(talk)->unanswered = true;
	return lose_step(talk, steps);
}
