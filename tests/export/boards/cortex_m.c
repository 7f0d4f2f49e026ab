/* The least start of a Cortex-M under qemu: stack, entry, floating point on. */
extern void _start(void);
void eaid_board(void);
__attribute__((section(".vectors"), used)) static void (*const vectors[2])(void) = {(void (*)(void))0x00300000, eaid_board};
void eaid_board(void)
{
    *(volatile unsigned int *)0xE000ED88U |= 0xF00000U;
    _start();
}
