"""Powers a drive, sends it to a position and waits: example.py HOST PORT UNIT POSITION (pymodbus 3.10)"""
import struct
import sys
import time

from pymodbus.client import ModbusTcpClient

STATUS, POSITION, RESULT, COMMAND_ID = 2, 12, 23, 100  # addresses, from 0
ENABLE, MOVE_ABSOLUTE, OK, PENDING, UNPROVEN, DONE = 1, 6, 1, 2, 18, 1 << 15
client, unit = ModbusTcpClient(sys.argv[1], port=int(sys.argv[2]), timeout=1), int(sys.argv[3])

def read(address, form):
    answer = client.read_holding_registers(address, count=struct.calcsize(form) // 2, device_id=unit)
    if answer.isError():
        sys.exit(f"cannot read {address}: {answer}")
    return struct.unpack(form, struct.pack(f">{len(answer.registers)}H", *answer.registers))[0]

def command(code, position=0):  # in one write; command_id 0: it executes each time
    words = [0, code, *struct.unpack(">2H", struct.pack(">i", position))]
    client.write_registers(COMMAND_ID, words, device_id=unit)
    while (result := read(RESULT, ">H")) == PENDING:  # exception 05: not confirmed yet
        time.sleep(0.02)
    if result not in (OK, UNPROVEN):
        sys.exit(f"command {code}: result {result}")

client.connect()
command(ENABLE)
command(MOVE_ABSOLUTE, int(sys.argv[4]))
while read(RESULT, ">H") in (OK, UNPROVEN) and not read(STATUS, ">I") & DONE:
    time.sleep(0.02)
print(read(POSITION, ">i"))
