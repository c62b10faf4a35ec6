/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The descriptor of every family, those of the tests too: what must be there, what may be null, and
 * what goes together.
 */
#include "driver/list.h"

#include "drivebridge/axis.h"
#include "drivebridge/command_table.h"
#include "fakes/rtu.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* When a member must be there. */
enum needed {
	ALWAYS,
	FOR_SERIAL,
	FOR_PARAMS,  /* if there are any */
	FOR_ARRAY,   /* if its count, the next member of the table, is not 0 */
	FOR_INQUIRY, /* if addresses can be asked */
	FOR_ELSEWHERE,
	FOR_AXES, /* if drives share addresses */
	FOR_COMMON_START,
	NEVER_NEEDED,
};

struct member {
	const char *name;
	size_t offset;
	enum needed needed;
};

#define MEMBER(name, needed)                                    \
	{                                                       \
#name, offsetof(struct db_driver, name), needed \
	}

/* Every pointer of struct db_driver. */
static const struct member members[] = {
	MEMBER(name, ALWAYS),
	MEMBER(title, ALWAYS),
	MEMBER(options, FOR_ARRAY),
	MEMBER(params, FOR_PARAMS),
	MEMBER(status_bits, FOR_ARRAY),
	MEMBER(faults, FOR_ARRAY),
	MEMBER(scale_unit, NEVER_NEEDED),
	MEMBER(velocity_unit, NEVER_NEEDED),
	MEMBER(velocity_counts, NEVER_NEEDED),
	MEMBER(check, NEVER_NEEDED),
	MEMBER(check_param, NEVER_NEEDED),
	MEMBER(input_ports, NEVER_NEEDED),
	MEMBER(forbidden, NEVER_NEEDED),
	MEMBER(not_measured, NEVER_NEEDED),
	MEMBER(check_config, NEVER_NEEDED),
	MEMBER(poll_time, ALWAYS),
	MEMBER(axis_time, NEVER_NEEDED),
	MEMBER(command_time, ALWAYS),
	MEMBER(init, ALWAYS),
	MEMBER(leave, FOR_AXES),
	MEMBER(inquire, NEVER_NEEDED),
	MEMBER(recognise, FOR_INQUIRY),
	MEMBER(speeds, NEVER_NEEDED),
	MEMBER(set_up_elsewhere, FOR_ELSEWHERE),
	MEMBER(messages, FOR_ARRAY),
	MEMBER(holds, NEVER_NEEDED),
	MEMBER(filters, NEVER_NEEDED),
	MEMBER(cut, FOR_SERIAL),
	MEMBER(frame_silence, NEVER_NEEDED),
	MEMBER(accept, NEVER_NEEDED),
	MEMBER(part, NEVER_NEEDED),
	MEMBER(describe, NEVER_NEEDED),
	MEMBER(begin, ALWAYS),
	MEMBER(answer, ALWAYS),
	MEMBER(lost, ALWAYS),
	MEMBER(report, NEVER_NEEDED),
	MEMBER(wants_poll, NEVER_NEEDED),
	MEMBER(gone, NEVER_NEEDED),
	MEMBER(feedback, ALWAYS),
	MEMBER(nameplate, FOR_PARAMS),
	MEMBER(broadcast, NEVER_NEEDED),
	MEMBER(interrupt, NEVER_NEEDED),
	MEMBER(mishears, NEVER_NEEDED),
	MEMBER(begin_all, NEVER_NEEDED),
	MEMBER(begun_by_all, FOR_COMMON_START),
};

static bool is_set(const struct db_driver *driver, const struct member *member)
{
	static const unsigned char null[sizeof(void (*)(void))];

	return memcmp((const unsigned char *)driver + member->offset, null, sizeof null) != 0;
}

static size_t count_of(const struct db_driver *driver, const char *name)
{
	if (strcmp(name, "options") == 0)
		return driver->option_count;
	if (strcmp(name, "faults") == 0)
		return driver->fault_count;
	if (strcmp(name, "messages") == 0)
		return driver->message_count;
	return driver->status_bit_count;
}

static bool is_needed(const struct db_driver *driver, const struct member *member)
{
	switch (member->needed) {
	case ALWAYS:
		return true;
	case FOR_SERIAL:
		return driver->medium == DB_MEDIUM_SERIAL;
	case FOR_PARAMS:
		return driver->param_count > 0;
	case FOR_ARRAY:
		return count_of(driver, member->name) > 0;
	case FOR_INQUIRY:
		return driver->inquire != NULL;
	case FOR_ELSEWHERE:
		return driver->inquire && (driver->address_effect == DB_TAKES_EFFECT_NEVER ||
		                           driver->speed_effect == DB_TAKES_EFFECT_NEVER);
	case FOR_AXES:
		return driver->axes > 0;
	case FOR_COMMON_START:
		return driver->begin_all != NULL;
	default:
		return false;
	}
}

static void check_members(const struct db_driver *driver)
{
	for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
		if (is_needed(driver, &members[i]) && !is_set(driver, &members[i]))
			fail_msg("%s: %s is missing", driver->name, members[i].name);
	}
}

static void check_params(const struct db_driver *driver)
{
	const int named[] = { driver->acceleration_param, driver->deceleration_param,
		              driver->preset_velocity_param };

	assert_true(driver->param_count <= DB_PARAMS_MAX);
	for (size_t i = 0; driver->param_count > 0 && i < sizeof named / sizeof named[0]; i++)
		assert_in_range(named[i] + 1, 0, driver->param_count);
	for (size_t i = 0; i < driver->param_count; i++) {
		const struct db_param *param = &driver->params[i];

		assert_true(param->name && param->unit && param->description);
		assert_true(param->min <= param->max);
		for (size_t j = 0; j < i; j++)
			assert_string_not_equal(param->name, driver->params[j].name);
	}
}

/* Ascending, above the causes that all families share, each with a name of its own. */
static void check_faults(const struct db_driver *driver)
{
	for (size_t i = 0; i < driver->fault_count; i++) {
		const struct db_drive_fault *fault = &driver->faults[i];

		assert_true(fault->error >= DB_ERROR_DRIVE_FAULT);
		assert_true(i == 0 || fault->error > driver->faults[i - 1].error);
		assert_true(fault->name && fault->check && fault->check[0] != '\0');
		assert_ptr_equal(db_driver_fault(driver, fault->error), fault);
		assert_string_equal(db_error_name(driver, fault->error), fault->name);
		for (size_t j = 0; j < i; j++)
			assert_string_not_equal(fault->name, driver->faults[j].name);
	}
}

static void check_rest(const struct db_driver *driver)
{
	assert_true(driver->device_size > 0);
	assert_true(driver->axes <= DB_AXES_MAX);
	assert_true(driver->address_min <= driver->address_max);
	for (size_t i = 0; i < db_command_row_count; i++)
		assert_true(db_command_rows[i].code < DB_CMD_LIMIT);
	for (enum db_command command = DB_CMD_NONE; command < DB_CMD_LIMIT; command++) {
		if (driver->commands & DB_COMMAND_BIT(command))
			assert_non_null(db_command_find(command));
	}
	/* What can be moved can be stopped. */
	if (driver->commands != 0)
		assert_true(driver->commands & DB_COMMAND_BIT(DB_CMD_STOP));
}

static void check(const struct db_driver *driver)
{
	check_members(driver);
	check_params(driver);
	check_faults(driver);
	check_rest(driver);
}

static void every_descriptor_is_whole(void **state)
{
	(void)state;
	for (size_t i = 0; db_drivers[i]; i++)
		check(db_drivers[i]);
	check(&fake_family);
	check(&rtu_family);
}

/* The made-up family leaves out what may be left out, so that each use of it is tried. */
static void what_may_be_null_is_null_in_the_family_of_tests(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
		const struct member *member = &members[i];

		if (strcmp(member->name, "frame_silence") != 0 &&
		    strcmp(member->name, "accept") != 0 && !is_needed(&rtu_family, member) &&
		    is_set(&rtu_family, member))
			fail_msg("%s could be left out", member->name);
	}
}

/* Families with one page share the parameters that are there. */
static void pages_of_parameters_do_not_overlap(void **state)
{
	(void)state;
	for (size_t i = 0; db_drivers[i]; i++) {
		for (size_t j = 0; j < i; j++) {
			const struct db_driver *a = db_drivers[i];
			const struct db_driver *b = db_drivers[j];

			if (a->param_page != b->param_page)
				continue;
			for (size_t k = 0; k < a->param_count && k < b->param_count; k++)
				assert_string_equal(a->params[k].name, b->params[k].name);
		}
	}
}

/* A PLC and the page ask whether the velocity is the drive's own. */
static void only_an_xyza_controller_does_not_tell_its_velocity(void **state)
{
	(void)state;
	for (size_t i = 0; db_drivers[i]; i++) {
		bool computed = strcmp(db_drivers[i]->name, "xyza") == 0;

		assert_int_equal(!(db_drivers[i]->measures & DB_MEASURE_VELOCITY), computed);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_descriptor_is_whole),
		cmocka_unit_test(what_may_be_null_is_null_in_the_family_of_tests),
		cmocka_unit_test(pages_of_parameters_do_not_overlap),
		cmocka_unit_test(only_an_xyza_controller_does_not_tell_its_velocity),
	};

	return cmocka_run_group_tests_name("driver: descriptors of the families", tests, NULL,
	                                   NULL);
}
