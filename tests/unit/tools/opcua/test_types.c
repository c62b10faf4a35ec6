/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/types.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

static const struct db_opcua_type_row *find(const char *id)
{
	return db_opcua_type_find(id, strlen(id));
}

/* The search needs their order; other rows are named by their places. */
static void test_rows_are_sorted_and_refer_to_rows(void **state)
{
	(void)state;
	assert_true(db_opcua_type_count > 500);
	for (size_t i = 0; i < db_opcua_type_count; i++) {
		const struct db_opcua_type_row *row = &db_opcua_type_rows[i];

		assert_true(i == 0 || strcmp(db_opcua_type_rows[i - 1].id, row->id) < 0);
		assert_ptr_equal(find(row->id), row);
		assert_true(row->above < (int)db_opcua_type_count);
		assert_true(row->data < (int)db_opcua_type_count);
		assert_true(row->above >= 0 || row->standard > 0);
		assert_true(row->text[0] != '\0');
		/* What is not a type stands below its owner. */
		if (row->class > DB_OPCUA_DATA_TYPE_ROW) {
			const char *owner = db_opcua_type_rows[row->above].id;

			assert_int_equal(strncmp(row->id, owner, strlen(owner)), 0);
			assert_int_equal(row->id[strlen(owner)], '.');
			assert_string_equal(db_opcua_type_name(row), row->id + strlen(owner) + 1);
		}
		if (row->data >= 0)
			assert_int_equal(db_opcua_type_data(row)->class, DB_OPCUA_DATA_TYPE_ROW);
	}
}

static void test_no_such_row(void **state)
{
	(void)state;
	assert_null(find(""));
	assert_null(find("Drive"));
	assert_null(find("DriveTypes"));
	assert_null(find("zzz"));
	assert_ptr_equal(db_opcua_type_find("DriveType.AxisState", 9), find("DriveType"));
}

static void test_families_have_types(void **state)
{
	static const struct {
		const char *family;
		const char *type;
	} types[] = {
		{ "vsmd-serial", "VsmdSerialDriveType" },
		{ "vsmd-can", "VsmdCanDriveType" },
		{ "xyza", "XyzaDriveType" },
		{ "servo-can", "ServoCanDriveType" },
		{ "of-tomorrow", "DriveType" },
		{ "", "DriveType" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++)
		assert_string_equal(db_opcua_type_of_family(types[i].family)->id, types[i].type);
	assert_string_equal(db_opcua_type_of_gateway()->id, "GatewayType");
	assert_string_equal(db_opcua_type_of_bus()->id, "BusType");
}

/* The nearest type that has it. */
static void test_members_are_inherited(void **state)
{
	const struct db_opcua_type_row *serial = db_opcua_type_of_family("vsmd-serial");
	const struct db_opcua_type_row *row = db_opcua_type_member(serial, "AxisState");

	(void)state;
	assert_string_equal(row->id, "DriveType.AxisState");
	assert_string_equal(db_opcua_type_data(row)->id, "AxisStateEnum");
	assert_true(db_opcua_type_is_enumeration(db_opcua_type_data(row)));
	row = db_opcua_type_member(serial, "Parameters.spd");
	assert_string_equal(row->id, "VsmdDriveType.Parameters.spd");
	assert_null(db_opcua_type_data(row));
	row = db_opcua_type_member(serial, "DriveStatusWord");
	assert_string_equal(db_opcua_type_data(row)->id, "VsmdSerialStatusBits");
	assert_false(db_opcua_type_is_enumeration(db_opcua_type_data(row)));
	assert_null(db_opcua_type_member(serial, "NoSuchMember"));
	assert_null(db_opcua_type_member(db_opcua_type_of_family("xyza"), "Parameters.spd"));
	assert_null(db_opcua_type_data(NULL));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_rows_are_sorted_and_refer_to_rows),
		cmocka_unit_test(test_no_such_row),
		cmocka_unit_test(test_families_have_types),
		cmocka_unit_test(test_members_are_inherited),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
