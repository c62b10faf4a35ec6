/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which table of steps a job goes through. An answer contains only the order that it answers, and a
 * late one fits any later request of that order: so one request is in progress at a time, and after
 * a lost answer the controller is first asked whether it is there, the only request with that
 * order.
 */
#include "driver/xyza/xyza_private.h"

/* Number of repeats: a controller also refuses a frame that arrived with a wrong checksum. */
#define REFUSALS_MAX 1

static enum db_step send_online(struct db_conversation *talk)
{
	const struct xyza_request request = { .verb = XYZA_VERB_ONLINE,
		                              .axis = talk->device->axis };

	return xyza_send(talk, request, true);
}

static const struct conversation_step probe_steps[] = {
	{ .send = send_online, .answered = end_done },
};

static bool is_raw(const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && job->request->command == DB_CMD_RAW_FRAME;
}

/* Not for raw frames, which are one request and its answer. */
static const struct conversation_step *steps_of(const struct db_job *job)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		return probe_steps;
	case DB_JOB_POLL:
		return xyza_poll_steps;
	case DB_JOB_IDENTIFY:
		return xyza_item_steps;
	case DB_JOB_COMMAND:
		if (job->request->command == DB_CMD_READ_PARAMETERS)
			return xyza_item_steps;
		/* fall through */
	case DB_JOB_SETTINGS:
	default:
		return xyza_plan_steps;
	}
}

enum db_step xyza_begin(struct db_conversation *talk)
{
	struct db_device *const *axes;
	enum db_command command;
	bool all;

	talk->device->refusals[talk->job->kind] = 0;
	switch (talk->job->kind) {
	case DB_JOB_PROBE:
		return send_step(talk, probe_steps, 0);
	case DB_JOB_IDENTIFY:
		return xyza_read_items(talk, 0);
	case DB_JOB_POLL:
		return xyza_begin_poll(talk);
	case DB_JOB_SETTINGS:
		return xyza_begin_settings(talk);
	case DB_JOB_COMMAND:
	default:
		break;
	}
	/* The effect of a command is no sign of a restart; a program moves all axes. */
	axes = talk->device->first->axes;
	command = talk->job->request->command;
	all = command == DB_CMD_START_PROGRAM || command == DB_CMD_CONTINUE_PROGRAM;
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (axes[i] && (all || axes[i] == talk->device))
			restart_note_command(&axes[i]->restart, command, talk->now);
	}
	if (command == DB_CMD_CLEAR_FAULT)
		(void)restart_settle(&talk->device->restart);
	switch (command) {
	case DB_CMD_READ_PARAMETERS:
		return xyza_read_items(talk, 0);
	case DB_CMD_RAW_FRAME:
		return xyza_begin_raw(talk);
	default:
		return xyza_begin_command(talk);
	}
}

enum db_step xyza_answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	const struct conversation_step *steps = steps_of(talk->job);
	const struct conversation_step *step = &steps[talk->job->step];
	unsigned *refusals = &talk->device->refusals[talk->job->kind];
	const struct db_exchange *exchange = talk->exchange;
	enum xyza_error error = XYZA_OK;
	struct xyza_request request;
	struct xyza_reply reply;
	enum db_step next;

	if (is_raw(talk->job))
		return xyza_answer_raw(talk, frame, length);
	if (xyza_decode_reply(frame, length, &reply) != XYZA_OK)
		return DB_STEP_IGNORE;
	/* What was sent is read back. A written item may have undocumented bits, as they were
	 * read. */
	if (talk->job->kind == DB_JOB_POLL)
		request = talk->device->poll_request;
	else
		error = xyza_decode_request(exchange->request, exchange->request_length, &request);
	if (error != XYZA_OK && error != XYZA_ERR_RANGE)
		return DB_STEP_IGNORE;
	/* A controller that accepts its new number at once may already answer with it. */
	if (reply.object == xyza_new_number(&request))
		request.object = reply.object;
	if (!xyza_fits(&request, &reply))
		return DB_STEP_IGNORE;
	/* A refused request was not carried out, so any request may be sent again, unchanged. */
	if (reply.kind == XYZA_REPLY_FAILED && *refusals < REFUSALS_MAX &&
	    !(steps == xyza_plan_steps && xyza_is_refusal_final(talk))) {
		(*refusals)++;
		return DB_STEP_SEND;
	}
	*refusals = 0;
	// cppcheck-suppress autoVariables ; it is taken away below
	talk->reply = &reply;
	if (steps == xyza_plan_steps)
		xyza_note_answer(talk);
	next = reply.kind == XYZA_REPLY_FAILED && step->refused ? step->refused(talk) :
	                                                          step->answered(talk);
	talk->reply = NULL;
	return next;
}

enum db_step xyza_lose_answer(struct db_conversation *talk)
{
	if (talk->job->kind == DB_JOB_SETTINGS)
		talk->device->plate.doubtful = true;
	if (!is_raw(talk->job))
		return lose_step(talk, steps_of(talk->job));
	xyza_forget_all(talk->device->first);
	return end_job(talk, DB_RESULT_INDETERMINATE);
}
